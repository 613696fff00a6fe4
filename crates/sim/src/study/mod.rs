//! Studies: many runs that answer one question, and their tables.

pub mod compare;
mod compare_text;
pub mod crossing;
pub mod online;
pub mod reproduce;
pub mod robustness;
pub mod robustness_text;
mod spread;
pub mod table2;
mod table2_text;
mod wrapped;

pub use compare::{CompareError, CompareStudy, Comparison, Controllers, Known};
pub use spread::Spread;
pub use table2::{PaperFigures, Row, RowPlan, Run, Table2, Table2Study};
