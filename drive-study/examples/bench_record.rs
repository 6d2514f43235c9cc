//! The record in `examples/bench.csv`: `cargo run --release -p drive-study --example bench_record > examples/bench.csv`.
#![allow(
    missing_docs,
    non_snake_case,
    clippy::cast_possible_truncation,
    clippy::cast_sign_loss,
    clippy::cast_precision_loss
)]

#[path = "../tests/common/on_bench.rs"]
mod on_bench;

fn main() {
    print!("{}", on_bench::record(on_bench::drive(), on_bench::TIME, on_bench::EVERY));
}
