//! Tests that cross crates, one module a subject.

mod contract; // what every source promises, and that broken promises are noticed
mod end_to_end; // driver, oracle and renderer together
mod kit; // sources made by hand
mod no_linfa; // judging alone needs no machinery of training
mod numerics; // extreme radiance, odd sizes, uneven halves
mod people; // what people said of real renders
