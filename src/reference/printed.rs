//! The values that the paper prints.
//!
//! Table 6.11 is labelled eta = .0625 there, but holds the data of eta = .03125.

/// Elements n of the tables of field sizes.
pub const SIZES: [usize; 8] = [10, 40, 160, 640, 2560, 10240, 40960, 163840];

/// Table 6.1: sigma_G, the largest gray field.
pub const GRAY: [u64; 8] = [2, 6, 14, 28, 60, 118, 248, 508];

/// The admissibilities of Tables 6.2 and 6.3.
pub const FIELD_ETAS: [f64; 3] = [0.125, 0.0625, 0.03125];

/// Table 6.2: sigma_N, the largest near field, for each eta.
pub const NEAR: [[u64; 8]; 3] = [
    [6, 16, 70, 128, 232, 262, 262, 262],
    [6, 24, 78, 300, 508, 922, 1044, 1044],
    [6, 24, 96, 334, 1206, 2022, 3700, 4184],
];

/// Table 6.3: sigma_F, the largest far field, for each eta.
pub const FAR: [[u64; 8]; 3] = [
    [2, 8, 60, 248, 670, 1116, 1824, 2598],
    [0, 8, 32, 256, 972, 2686, 4464, 7242],
    [0, 0, 32, 128, 1034, 3860, 10878, 17754],
];

/// One table of errors: for n = 40, 160, ... 163840 and three orders.
pub struct ErrorTable {
    /// Its number.
    pub name: &'static str,
    /// Admissibility.
    pub eta: f64,
    /// Orders m of the columns.
    pub orders: [usize; 3],
    /// Largest errors at the nodes.
    pub errors: [[f64; 3]; 7],
    /// Seconds an iteration, on a 2 GHz Xeon of 2005; empty where none are printed.
    pub seconds: &'static [[f64; 3]; 7],
}

/// Where no times are printed.
const NO_TIMES: [[f64; 3]; 7] = [[f64::NAN; 3]; 7];

/// Tables 6.4 to 6.6: solution (6.8).
pub const INDICATOR: [ErrorTable; 3] = [
    ErrorTable {
        name: "6.4",
        eta: 0.5,
        orders: [2, 4, 6],
        errors: [
            [6.54e-4, 1.16e-4, 2.41e-5],
            [3.39e-3, 3.22e-4, 2.75e-5],
            [2.35e-3, 3.17e-4, 3.59e-5],
            [2.77e-3, 3.13e-4, 5.28e-5],
            [2.81e-3, 3.18e-4, 5.27e-5],
            [2.81e-3, 3.19e-4, 5.28e-5],
            [2.82e-3, 3.19e-4, 5.28e-5],
        ],
        seconds: &NO_TIMES,
    },
    ErrorTable {
        name: "6.5",
        eta: 0.125,
        orders: [2, 4, 6],
        errors: [
            [9.88e-16, 9.88e-16, 9.88e-16],
            [2.87e-15, 2.87e-15, 2.87e-15],
            [5.17e-5, 1.98e-7, 1.78e-9],
            [1.83e-4, 8.06e-7, 2.9e-9],
            [1.25e-4, 7.58e-7, 3.31e-9],
            [1.27e-4, 7.57e-7, 4.44e-9],
            [1.29e-4, 7.6e-7, 5.31e-9],
        ],
        seconds: &NO_TIMES,
    },
    ErrorTable {
        name: "6.6",
        eta: 0.03125,
        orders: [2, 4, 6],
        errors: [
            [9.88e-16, 9.88e-16, 9.88e-16],
            [2.87e-15, 2.87e-15, 2.87e-15],
            [2.68e-15, 2.68e-15, 2.68e-15],
            [5.7e-9, 7.33e-12, 6.68e-15],
            [3.14e-6, 6.69e-10, 3.71e-13],
            [1.11e-5, 3.1e-9, 5.53e-13],
            [7.57e-6, 2.89e-9, 6.86e-13],
        ],
        seconds: &NO_TIMES,
    },
];

/// Tables 6.9 to 6.11: solution (5.2) with beta = 1, gamma = 1.5.
pub const KINKED: [ErrorTable; 3] = [
    ErrorTable {
        name: "6.9",
        eta: 0.5,
        orders: [1, 3, 5],
        errors: [
            [1.38e-3, 1.31e-3, 1.3e-3],
            [1.17e-3, 2.01e-4, 9.67e-5],
            [1.41e-3, 2.69e-4, 1.64e-4],
            [1.4e-3, 2.67e-4, 2.33e-4],
            [1.41e-3, 2.79e-4, 2.71e-4],
            [1.41e-3, 2.9e-4, 2.8e-4],
            [1.41e-3, 2.94e-4, 2.86e-4],
        ],
        seconds: &[
            [2.0e-3, 2.5e-3, 3.5e-3],
            [1.25e-2, 1.4e-2, 2.2e-2],
            [6.6e-2, 7.55e-2, 1.315e-1],
            [5.72e-1, 6.085e-1, 7.07e-1],
            [3.45e0, 2.516e0, 4.168e0],
            [1.942e1, 1.684e1, 2.785e1],
            [1.106e2, 1.215e2, 1.338e2],
        ],
    },
    ErrorTable {
        name: "6.10",
        eta: 0.125,
        orders: [1, 3, 5],
        errors: [
            [1.3e-3, 1.3e-3, 1.3e-3],
            [1.05e-4, 9.53e-5, 9.53e-5],
            [1.02e-4, 1.08e-4, 1.08e-4],
            [7.11e-5, 3.11e-5, 3.1e-5],
            [7.14e-5, 8.58e-6, 8.66e-6],
            [7.14e-5, 1.09e-5, 1.1e-5],
            [7.14e-5, 1.05e-5, 1.07e-5],
        ],
        seconds: &[
            [3.7e-3, 4.0e-3, 3.7e-3],
            [4.17e-2, 4.2e-2, 4.37e-2],
            [3.44e-1, 3.733e-1, 4.27e-1],
            [2.117e0, 2.377e0, 2.905e0],
            [1.065e1, 1.219e1, 1.55e1],
            [5.123e1, 5.856e1, 7.406e1],
            [2.599e2, 2.945e2, 3.646e2],
        ],
    },
    ErrorTable {
        name: "6.11",
        eta: 0.03125,
        orders: [1, 3, 5],
        errors: [
            [1.3e-3, 1.3e-3, 1.3e-3],
            [9.53e-5, 9.53e-5, 9.53e-5],
            [1.08e-4, 1.08e-4, 1.08e-4],
            [3.11e-5, 3.08e-5, 3.08e-5],
            [4.37e-6, 4.28e-6, 4.28e-6],
            [4.44e-6, 1.33e-6, 1.33e-6],
            [4.45e-6, 4.84e-7, 4.84e-7],
        ],
        seconds: &[
            [4.0e-3, 4.0e-3, 4.3e-3],
            [5.93e-2, 6.03e-2, 6.1e-2],
            [8.14e-1, 8.093e-1, 8.253e-1],
            [1.005e1, 1.015e1, 1.071e1],
            [8.763e1, 9.934e1, 1.122e2],
            [6.225e2, 7.487e2, 8.912e2],
            [3.301e3, 3.923e3, 4.894e3],
        ],
    },
];

/// Admissibilities of Table 6.7.
pub const ETAS: [f64; 5] = [0.5, 0.25, 0.125, 0.0625, 0.03125];

/// Table 6.7: error for n = 163840 and orders 2 and 4, for each eta.
pub const BY_ETA: [[f64; 2]; 5] = [
    [2.82e-3, 3.19e-4],
    [5.89e-4, 1.34e-5],
    [1.29e-4, 7.6e-7],
    [3.03e-5, 4.69e-8],
    [7.57e-6, 2.89e-9],
];

/// Table 6.7: ratios of successive errors.
pub const ETA_RATIOS: [[f64; 2]; 4] = [[4.79, 23.8], [4.57, 17.6], [4.26, 16.2], [4.0, 16.2]];

/// Table 6.8: error of linear collocation for n = 40, 160, ... 163840.
pub const COLLOCATION: [f64; 7] = [1.3e-3, 9.53e-5, 1.08e-4, 3.08e-5, 4.28e-6, 1.33e-6, 4.84e-7];

/// Table 6.8: ratios of successive errors.
pub const COLLOCATION_RATIOS: [f64; 6] = [13.6, 0.88, 3.51, 7.2, 3.22, 2.75];
