//! The design of specimens.

mod local;
mod qp;
mod space;
mod study;
