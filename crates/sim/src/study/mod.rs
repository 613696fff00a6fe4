//! Studies: many runs that answer one question, and their tables.

mod spread;
pub mod table2;
mod table2_text;

pub use spread::Spread;
pub use table2::{PaperFigures, Row, RowPlan, Run, Table2, Table2Study};
