//! The design of specimens.

mod criteria;
mod evaluator;
mod fe_evaluator;
mod fe_rates;
mod local;
mod margins;
mod objective;
mod qp;
mod space;
mod study;
