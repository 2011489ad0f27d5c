//! Parquet files as raw tables, and raw tables as Parquet: flat schemas of numbers (and text on the way out).
//!
//! The column-by-column interface of the `parquet` crate, without Arrow. What the columns mean is not known here.

use super::bounds::{FEW_NUMBERS, MOST_NUMBERS_A_BYTE};
use super::format::{Format, Place, Reader};
use super::guard::guarded;
use super::parquet_sizes::{check_footer, check_pages};
use super::source::Read;
use super::table::{RawTable, check_header, fault};
use super::values::{Table, Values};
use crate::error::{Error, Result};
use parquet::basic::{Compression, ConvertedType, Repetition, Type as Physical};
use parquet::column::reader::{ColumnReader, ColumnReaderImpl};
use parquet::data_type::{ByteArray, ByteArrayType, DataType, DoubleType};
use parquet::errors::{ParquetError, Result as ParquetResult};
use parquet::file::properties::WriterProperties;
use parquet::file::reader::{ChunkReader, FileReader, SerializedFileReader};
use parquet::file::writer::SerializedFileWriter;
use parquet::schema::types::Type;
use std::fs::File;
use std::path::Path;
use std::sync::Arc;

/// Parquet among the formats.
pub(super) const PARQUET: Format =
    Format { kind: "a Parquet file", place: Place::File("parquet"), description: None, reader: Reader::Table(read_parquet) };

/// Records read at a time; bounds memory whatever a damaged file claims to hold.
const BATCH: usize = 1 << 16;

/// Reads a Parquet file. Only columns that `wanted` accepts are read; a null is NaN, a boolean 0 or 1.
///
/// The `parquet` crate (60.1) panics on some damaged files: this is the border behind which that is an error.
///
/// # Errors
/// [`Error::Io`]; [`Error::Log`] for a file that is not Parquet or is damaged, a compression other than none and Snappy, nested or text
/// columns, no rows; [`Error::Cell`] for a doubled column.
pub(super) fn read_parquet(path: &Path, wanted: &dyn Fn(&str) -> bool) -> Result<RawTable> {
    let file = File::open(path).map_err(Error::io(path))?;
    let length = file.metadata().map_err(Error::io(path))?.len();
    let bytes =
        usize::try_from(length).map_err(|_| ParquetError::General("too long".into())).and_then(|length| file.get_bytes(0, length));
    let bytes = bytes.map_err(|error| damaged(path, &error))?;
    let read = Read::of(path, &bytes);
    let table = guarded(|| parse(path, bytes, wanted)).unwrap_or_else(|reason| Err(damaged(path, &reason)))?;
    Ok(RawTable { read: Some(read), ..table })
}

fn damaged(path: &Path, reason: &dyn std::fmt::Display) -> Error {
    let expected =
        "a Parquet file, uncompressed or with Snappy compression; the file is damaged or of another kind, write it again";
    fault(path, format!("unreadable Parquet ({reason})"), expected)
}

fn parse<B: ChunkReader + AsRef<[u8]> + Clone + 'static>(path: &Path, bytes: B, wanted: &dyn Fn(&str) -> bool) -> Result<RawTable> {
    let length = bytes.len();
    let damaged = |error: ParquetError| damaged(path, &error);
    check_footer(bytes.as_ref()).map_err(|claim| damaged(ParquetError::General(claim)))?;
    let content = bytes.clone();
    let mut left = content.as_ref().len().saturating_mul(MOST_NUMBERS_A_BYTE).max(FEW_NUMBERS);
    let reader = SerializedFileReader::new(bytes).map_err(damaged)?;
    let schema = reader.metadata().file_metadata().schema_descr_ptr();
    let names: Vec<String> = schema.columns().iter().map(|column| column.path().string()).collect();
    check_header(path, &names, wanted)?;
    let kept: Vec<usize> = (0..names.len()).filter(|&index| wanted(&names[index])).collect();
    let mut columns = vec![Vec::new(); kept.len()];
    for group in 0..reader.num_row_groups() {
        let group = reader.get_row_group(group).map_err(damaged)?;
        for (values, &index) in columns.iter_mut().zip(&kept) {
            let levels = schema.column(index).max_def_level();
            if schema.column(index).max_rep_level() > 0 || levels > 1 {
                return Err(fault(path, format!("a nested column, `{}`", names[index]), "flat columns of numbers"));
            }
            let chunk = group.metadata().column(index);
            let (start, size) = chunk.byte_range();
            if start.checked_add(size).is_none_or(|end| end > length) {
                let found = format!("the column `{}` at bytes {start} to {}", names[index], start.saturating_add(size));
                return Err(fault(
                    path,
                    found,
                    format!("a place within the file's {length} bytes; the file is damaged, write it again"),
                ));
            }
            // The place was found to be within the file.
            let pages = content.as_ref().get(start as usize..(start + size) as usize).unwrap_or_default();
            check_pages(pages).map_err(|claim| damaged(ParquetError::General(claim)))?;
            let column = group.get_column_reader(index).map_err(damaged)?;
            let known = read_column(column, levels == 1, values, &mut left).map_err(damaged)?;
            if !known {
                let expected = "numbers; a column that holds something else can be named in `ignore` of dataset.toml";
                return Err(fault(path, format!("text or bytes in the column `{}`", names[index]), expected));
            }
        }
    }
    let rows = columns.first().map_or(0, Vec::len);
    if rows == 0 {
        return Err(fault(path, "no rows", "at least one row; remove the file if the flight is void"));
    }
    if columns.iter().any(|values| values.len() != rows) {
        return Err(fault(path, "columns of different lengths", "columns of one length; the file is damaged, write it again"));
    }
    let names = kept.into_iter().map(|index| names[index].clone()).collect();
    Ok(RawTable { path: path.into(), names, columns, lines: (2..rows + 2).collect(), read: None })
}

/// Appends a chunk to `values`, at most so many numbers as are left; false if its type is not a number's.
fn read_column(reader: ColumnReader, nullable: bool, values: &mut Vec<f64>, left: &mut usize) -> ParquetResult<bool> {
    match reader {
        ColumnReader::BoolColumnReader(reader) => read_typed(reader, nullable, (values, left), |value| f64::from(u8::from(value))),
        ColumnReader::Int32ColumnReader(reader) => read_typed(reader, nullable, (values, left), f64::from),
        // Times in ns and counters: beyond 2^53 the nearest double.
        ColumnReader::Int64ColumnReader(reader) => read_typed(reader, nullable, (values, left), |value| value as f64),
        ColumnReader::FloatColumnReader(reader) => read_typed(reader, nullable, (values, left), f64::from),
        ColumnReader::DoubleColumnReader(reader) => read_typed(reader, nullable, (values, left), |value| value),
        _ => return Ok(false),
    }?;
    Ok(true)
}

fn read_typed<T: DataType>(
    mut reader: ColumnReaderImpl<T>,
    nullable: bool,
    (values, left): (&mut Vec<f64>, &mut usize),
    number: impl Fn(T::T) -> f64,
) -> ParquetResult<()> {
    let (mut present, mut levels) = (Vec::new(), Vec::new());
    loop {
        present.clear();
        levels.clear();
        let (records, _, _) = reader.read_records(BATCH, nullable.then_some(&mut levels), None, &mut present)?;
        if records == 0 {
            return Ok(());
        }
        *left = left.checked_sub(records).ok_or_else(|| ParquetError::General("more numbers than its bytes can be of".into()))?;
        let mut numbers = present.drain(..).map(&number);
        if nullable {
            values.extend(levels.iter().map(|&level| if level > 0 { numbers.next().unwrap_or(f64::NAN) } else { f64::NAN }));
        } else {
            values.extend(numbers);
        }
    }
}

/// The bytes of a Parquet file with these columns, whose lengths the caller has found equal.
pub(super) fn encode(table: &Table) -> ParquetResult<Vec<u8>> {
    let mut fields = Vec::with_capacity(table.len());
    for (name, values) in table {
        let field = match values {
            Values::Numbers(_) => Type::primitive_type_builder(name, Physical::DOUBLE),
            Values::Text(_) => Type::primitive_type_builder(name, Physical::BYTE_ARRAY).with_converted_type(ConvertedType::UTF8),
        };
        fields.push(Arc::new(field.with_repetition(Repetition::REQUIRED).build()?));
    }
    let schema = Arc::new(Type::group_type_builder("schema").with_fields(fields).build()?);
    // Noise does not repeat: a dictionary of doubles costs time and makes the file larger.
    let properties = WriterProperties::builder().set_compression(Compression::SNAPPY).set_dictionary_enabled(false).build();
    let mut writer = SerializedFileWriter::new(Vec::new(), schema, Arc::new(properties))?;
    let mut group = writer.next_row_group()?;
    for (_, values) in table {
        let mut column = group.next_column()?.ok_or_else(|| ParquetError::General("fewer columns than the schema has".into()))?;
        match values {
            Values::Numbers(values) => {
                column.typed::<DoubleType>().write_batch(values, None, None)?;
            }
            Values::Text(values) => {
                let values: Vec<ByteArray> = values.iter().map(|text| ByteArray::from(text.as_str())).collect();
                column.typed::<ByteArrayType>().write_batch(&values, None, None)?;
            }
        }
        column.close()?;
    }
    group.close()?;
    writer.into_inner()
}

#[cfg(test)]
mod tests {
    use super::super::write::table_parquet;
    use super::*;

    /// A thousand equal numbers a byte: a small file of any size.
    #[test]
    fn a_file_of_equal_numbers_holds_no_more_than_its_bytes_can_be_of() -> Result<(), Box<dyn std::error::Error>> {
        let field = Type::primitive_type_builder("x", Physical::DOUBLE).with_repetition(Repetition::REQUIRED).build()?;
        let schema = Arc::new(Type::group_type_builder("schema").with_fields(vec![Arc::new(field)]).build()?);
        let mut writer = SerializedFileWriter::new(Vec::new(), schema, Arc::default())?;
        let mut group = writer.next_row_group()?;
        let mut column = group.next_column()?.ok_or("a column")?;
        column.typed::<DoubleType>().write_batch(&vec![1.5; FEW_NUMBERS + BATCH], None, None)?;
        column.close()?;
        group.close()?;
        let bytes = writer.into_inner()?;
        assert!(bytes.len() < FEW_NUMBERS / MOST_NUMBERS_A_BYTE, "{} bytes", bytes.len());
        let folder = tempfile::tempdir()?;
        let path = folder.path().join("a.parquet");
        std::fs::write(&path, &bytes)?;
        let refused = read_parquet(&path, &|_| true).map_err(|error| error.to_string());
        assert!(matches!(&refused, Err(text) if text.contains("more numbers than its bytes")), "{:?}", refused.map(|_| ()));
        Ok(())
    }

    #[test]
    fn numbers_come_back_with_their_bits_and_text_is_refused_by_name() -> Result<(), Box<dyn std::error::Error>> {
        let folder = tempfile::tempdir()?;
        let path = folder.path().join("a.parquet");
        let numbers: Vec<f64> = (0..BATCH + 10).map(|index| (index as f64).sin()).collect();
        let names = vec!["hover".to_owned(); numbers.len()];
        table_parquet(&path, &[("x", Values::Numbers(&numbers)), ("flight", Values::Text(&names))])?;
        let table = read_parquet(&path, &|name| name != "flight")?;
        assert!(table.columns[0].iter().zip(&numbers).all(|(a, b)| a.to_bits() == b.to_bits()) && table.rows() == numbers.len());
        let refused = read_parquet(&path, &|_| true).map_err(|error| error.to_string());
        assert!(matches!(refused, Err(text) if text.contains("text or bytes in the column `flight`")));
        std::fs::write(&path, b"t,x\n0,1\n")?;
        let refused = read_parquet(&path, &|_| true).map_err(|error| error.to_string());
        assert!(matches!(refused, Err(text) if text.contains("unreadable Parquet")));
        Ok(())
    }
}
