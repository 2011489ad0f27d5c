//! Pieces of sentences. What is said stands where it is known; how a line is broken is `wrap`'s, how a number is printed `digits`'.

/// `a, b and c`.
///
/// # Examples
/// ```
/// assert_eq!(phyture::critique::prose::listed(&["a", "b", "c"]), "a, b and c");
/// assert_eq!(phyture::critique::prose::listed(&["a"]), "a");
/// ```
pub fn listed(items: &[impl AsRef<str>]) -> String {
    let items: Vec<&str> = items.iter().map(AsRef::as_ref).collect();
    match items.split_last() {
        Some((last, others)) if !others.is_empty() => format!("{} and {last}", others.join(", ")),
        _ => items.concat(),
    }
}
