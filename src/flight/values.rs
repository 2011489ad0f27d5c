//! A table to be written, whatever kind of file it becomes.

/// Values of one column of a table.
#[derive(Clone, Copy, Debug)]
pub enum Values<'a> {
    /// Numbers.
    Numbers(&'a [f64]),
    /// Text, such as the name of the flight a row belongs to.
    Text(&'a [String]),
}

impl Values<'_> {
    pub(super) fn len(&self) -> usize {
        match self {
            Self::Numbers(values) => values.len(),
            Self::Text(values) => values.len(),
        }
    }
}

/// A table: columns of one length, by name, in the order of the header.
pub type Table<'a> = [(&'a str, Values<'a>)];
