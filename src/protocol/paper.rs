//! The numbers that the paper prints in its tables 1 to 6 (RMSE, m/s² and rad/s²; table 2: MAE and MaxAE), to stand beside ours. In Table 1 it prints
//! mean ± deviation over ten runs. They are of the Stanford flights; no computation uses them.

use super::cell::Cell;

/// Six channels in the order of the targets, then their mean.
pub type Printed = [f64; 7];

/// Table 1, by method.
const TABLE_1: [(&str, Printed); 9] = [
    ("physical_baseline", [6.03, 5.91, 6.53, 2.48, 2.63, 1.67, 4.21]),
    ("cnn", [1.76, 1.43, 1.73, 1.33, 1.58, 1.67, 1.58]),
    ("cnn_lstm", [0.73, 0.72, 0.63, 0.44, 0.69, 0.49, 0.62]),
    ("tcn", [1.46, 1.13, 1.41, 0.75, 0.77, 0.70, 1.04]),
    ("timesnet", [1.06, 0.74, 0.76, 0.58, 0.57, 0.47, 0.70]),
    ("timemixer", [0.76, 0.61, 0.78, 0.65, 0.68, 0.62, 0.68]),
    ("dlinear", [2.64, 2.15, 1.93, 0.79, 0.82, 0.67, 1.50]),
    ("informer", [1.32, 1.09, 1.23, 1.01, 0.96, 0.75, 1.06]),
    ("phyture", [0.37, 0.32, 0.42, 0.31, 0.29, 0.23, 0.32]),
];

/// The deviations of Table 1.
const TABLE_1_DEVIATIONS: [(&str, Printed); 8] = [
    ("cnn", [0.08, 0.06, 0.07, 0.05, 0.06, 0.07, 0.06]),
    ("cnn_lstm", [0.04, 0.02, 0.03, 0.03, 0.03, 0.02, 0.03]),
    ("tcn", [0.06, 0.05, 0.05, 0.04, 0.04, 0.03, 0.08]),
    ("timesnet", [0.06, 0.03, 0.04, 0.03, 0.02, 0.03, 0.04]),
    ("timemixer", [0.03, 0.03, 0.04, 0.03, 0.04, 0.03, 0.03]),
    ("dlinear", [0.11, 0.09, 0.08, 0.03, 0.04, 0.03, 0.07]),
    ("informer", [0.05, 0.04, 0.05, 0.04, 0.04, 0.04, 0.04]),
    ("phyture", [0.02, 0.01, 0.02, 0.01, 0.01, 0.01, 0.01]),
];

/// Table 2, by method and measure; it prints no mean.
const TABLE_2: [(&str, &str, [f64; 6]); 4] = [
    ("cnn_lstm", "MAE", [0.52, 0.42, 0.51, 0.36, 0.40, 0.40]),
    ("cnn_lstm", "MaxAE", [3.66, 3.73, 3.11, 2.09, 3.45, 2.44]),
    ("phyture", "MAE", [0.24, 0.19, 0.29, 0.22, 0.19, 0.20]),
    ("phyture", "MaxAE", [1.89, 1.57, 2.23, 1.55, 1.50, 1.38]),
];

/// Table 3, by method.
const TABLE_3: [(&str, Printed); 8] = [
    ("cnn", [2.25, 1.85, 2.10, 1.95, 2.15, 2.20, 2.08]),
    ("cnn_lstm", [0.88, 0.79, 1.03, 0.89, 1.06, 1.03, 0.95]),
    ("tcn", [1.95, 1.87, 2.13, 1.39, 1.61, 1.28, 1.71]),
    ("timesnet", [1.35, 1.20, 1.12, 1.18, 1.30, 0.96, 1.19]),
    ("timemixer", [1.15, 0.95, 1.37, 1.31, 1.56, 1.07, 1.24]),
    ("dlinear", [1.67, 1.55, 1.32, 0.83, 0.88, 0.92, 1.20]),
    ("informer", [1.65, 1.15, 1.25, 1.45, 1.40, 1.10, 1.33]),
    ("phyture", [0.44, 0.37, 0.49, 0.41, 0.35, 0.46, 0.42]),
];

/// Table 4, by method; the paper does not say which reading "without TSDP" is.
const TABLE_4: [(&str, Printed); 5] = [
    ("without_paf", [0.48, 0.34, 0.45, 0.43, 0.32, 0.38, 0.40]),
    ("without_mstfe", [2.84, 1.81, 1.80, 0.32, 0.34, 0.30, 1.24]),
    ("without_tsdp_linear", [0.51, 0.58, 0.55, 0.54, 0.48, 0.48, 0.52]),
    ("without_tsdp_last", [0.51, 0.58, 0.55, 0.54, 0.48, 0.48, 0.52]),
    ("phyture", [0.37, 0.32, 0.42, 0.31, 0.29, 0.23, 0.32]),
];

/// Table 5, by method.
const TABLE_5: [(&str, Printed); 5] = [
    ("average_5", [0.44, 0.40, 0.49, 0.36, 0.35, 0.29, 0.39]),
    ("average_15", [0.40, 0.31, 0.44, 0.33, 0.31, 0.22, 0.34]),
    ("average_25", [0.37, 0.32, 0.42, 0.31, 0.29, 0.23, 0.32]),
    ("average_35", [0.37, 0.32, 0.43, 0.32, 0.33, 0.24, 0.34]),
    ("average_45", [0.41, 0.39, 0.43, 0.35, 0.39, 0.26, 0.37]),
];

/// Table 6, by method.
const TABLE_6: [(&str, Printed); 4] = [
    ("state_control_only", [0.69, 0.67, 0.70, 0.55, 0.65, 0.52, 0.63]),
    ("direct_concatenation", [0.57, 0.54, 0.48, 0.49, 0.53, 0.46, 0.51]),
    ("without_paf", [0.48, 0.34, 0.45, 0.43, 0.32, 0.38, 0.40]),
    ("phyture", [0.37, 0.32, 0.42, 0.31, 0.29, 0.23, 0.32]),
];

/// The row of a method in a table of RMSE (1, 3, 4, 5 or 6), if the paper has it.
pub fn printed(table: u8, method: &str) -> Option<[Cell; 7]> {
    let rows: &[(&str, Printed)] = match table {
        1 => &TABLE_1,
        3 => &TABLE_3,
        4 => &TABLE_4,
        5 => &TABLE_5,
        6 => &TABLE_6,
        _ => &[],
    };
    let of = |rows: &[(&str, Printed)]| rows.iter().find(|(id, _)| *id == method).map(|(_, row)| *row);
    let deviations = Some(TABLE_1_DEVIATIONS).filter(|_| table == 1).and_then(|rows| of(&rows));
    let row = of(rows)?;
    Some(std::array::from_fn(|column| Cell { mean: row[column], deviation: deviations.map(|deviations| deviations[column]) }))
}

/// The row of a method and measure in Table 2, with the mean of its channels.
pub fn printed_worst(method: &str, measure: &str) -> Option<[Cell; 7]> {
    let (_, _, row) = TABLE_2.iter().find(|(id, of, _)| *id == method && *of == measure)?;
    let mean = row.iter().sum::<f64>() / 6.0;
    Some(std::array::from_fn(|column| Cell { mean: row.get(column).copied().unwrap_or(mean), deviation: None }))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Every printed mean is that of its channels to the digits printed (means of rounded figures: half a unit of each).
    #[test]
    fn printed_means_are_those_of_their_channels() {
        for (_, row) in TABLE_1.iter().chain(&TABLE_3).chain(&TABLE_4).chain(&TABLE_5).chain(&TABLE_6) {
            let mean = row[..6].iter().sum::<f64>() / 6.0;
            assert!((mean - row[6]).abs() <= 0.0101, "{row:?}: {mean}");
        }
    }
}
