//! What it costs to carry a step between two processes: conversion, encoding, decoding, digest.

use criterion::{BatchSize, BenchmarkId, Criterion, Throughput, criterion_group, criterion_main};
use prost::Message as _;
use proto::digest;
use proto::types::{AgentStates, Deliveries, Heard, Payloads, Transmissions};
use proto_messages::{convert, v1};
use std::hint::black_box;

/// Bytes that a built-in robot says.
const PAYLOAD_BYTES: usize = 48;

fn states(n: usize) -> AgentStates {
    let mut states = AgentStates::at_origin(n);
    for agent in 0..n {
        states.x_m[agent] = agent as f64 * 0.5;
        states.y_m[agent] = -(agent as f64);
    }
    states
}

/// Everyone hears everyone: the bitmap form.
fn deliveries(n: usize) -> Deliveries {
    let row_bytes = n.div_ceil(8);
    let mut row = vec![0xff; row_bytes];
    if !n.is_multiple_of(8) {
        row[row_bytes - 1] = (1 << (n % 8)) - 1;
    }
    Deliveries {
        transmissions: Transmissions {
            sender: (0..n as u32).collect(),
            sent_ns: vec![0; n],
            end_ns: vec![10_000_000; n],
            payloads: Payloads::new(
                vec![PAYLOAD_BYTES as u32; n],
                vec![7; n * PAYLOAD_BYTES].into(),
            )
            .unwrap_or_default(),
            ..Transmissions::default()
        },
        heard: Heard::Rows { bytes: row.repeat(n).into(), row_bytes },
        ..Deliveries::default()
    }
}

fn exchange(c: &mut Criterion) {
    let mut group = c.benchmark_group("exchange");
    for n in [10, 100, 1000, 2500] {
        let (states, deliveries) = (states(n), deliveries(n));
        let message = || v1::RobotSimServiceStepRequest {
            step: 1,
            until_ns: 1,
            deliveries: Some(deliveries.clone().into()),
            ..Default::default()
        };
        let bytes = message().encode_to_vec();
        group.throughput(Throughput::Bytes(bytes.len() as u64));
        group.bench_function(BenchmarkId::new("encode", n), |b| {
            b.iter_batched(
                message,
                |message| black_box(message.encode_to_vec()),
                BatchSize::LargeInput,
            );
        });
        group.bench_function(BenchmarkId::new("decode and check", n), |b| {
            b.iter(|| {
                let message = v1::RobotSimServiceStepRequest::decode(black_box(&bytes[..])).ok()?;
                convert::deliveries(message.deliveries, n).ok()
            });
        });
        group.bench_function(BenchmarkId::new("digest", n), |b| {
            b.iter(|| digest::of_step(1, 1, black_box(&states), Some(black_box(&deliveries))));
        });
    }
    group.finish();
}

criterion_group!(benches, exchange);
criterion_main!(benches);
