//! Every verb as its users call it: what it prints, what it writes, how it ends.

mod common;
mod compare;
mod eigenvalues;
mod every_verb;
mod explain;
mod help;
mod init;
mod live;
mod log;
mod map;
mod plan;
mod plot;
mod report;
mod reproduce;
mod run;
mod schema;
mod sweep;
mod table2;
mod verify;
mod width;
