//! The contents of `/metrics`, for Prometheus.

use super::shared::Shared;
use prometheus_client::collector::Collector;
use prometheus_client::encoding::{DescriptorEncoder, EncodeGaugeValue, prometheus_text};
use prometheus_client::metrics::MetricType;
use prometheus_client::registry::Registry;
use std::fmt;
use std::sync::{Arc, Weak};

/// The text of `/metrics`.
pub(super) fn text(shared: &Arc<Shared>) -> Result<String, fmt::Error> {
    let mut registry = Registry::with_prefix("lightcast");
    registry.register_collector(Box::new(Figures(Arc::downgrade(shared))));
    let mut text = String::new();
    prometheus_text::encode(&mut text, &registry)?;
    Ok(text)
}

/// Reads all values again for every answer.
#[derive(Debug)]
struct Figures(Weak<Shared>);

impl Collector for Figures {
    fn encode(&self, mut encoder: DescriptorEncoder) -> fmt::Result {
        let Some(shared) = self.0.upgrade() else { return Ok(()) };
        let mut stages = shared.board.stages.all();
        stages.push(shared.metrics.clone());
        counters(
            &mut encoder,
            "stage_frames",
            "Items worked off",
            stages.iter().map(|stage| ([("stage", stage.name())], stage.frames.get())),
        )?;
        counters(
            &mut encoder,
            "stage_drops",
            "Items that the stage was too slow for",
            stages.iter().map(|stage| ([("stage", stage.name())], stage.drops.get())),
        )?;
        counters(
            &mut encoder,
            "stage_bad_frames",
            "Items that the stage refused",
            stages.iter().map(|stage| ([("stage", stage.name())], stage.bad_frames.get())),
        )?;
        let quantiles = [("0.5", 0.5), ("0.99", 0.99), ("1", 1.0)];
        gauges(
            &mut encoder,
            "stage_time_seconds",
            "Time for an item since the start, without waits for neighbours",
            stages.iter().flat_map(|stage| {
                quantiles.map(|(label, fraction)| {
                    let time_s = stage.time_ns.percentile(fraction) as f64 * 1e-9;
                    ([("stage", stage.name()), ("quantile", label)], time_s)
                })
            }),
        )?;
        let counted: Vec<_> = stages.iter().map(|stage| (stage.name(), stage.counters())).collect();
        counters(
            &mut encoder,
            "stage_events",
            "What else the stages count",
            counted.iter().flat_map(|(stage, counters)| {
                counters.iter().map(|&(event, count)| ([("stage", *stage), ("event", event)], count))
            }),
        )?;
        let none: [(&str, &str); 0] = [];
        gauges(
            &mut encoder,
            "clients",
            "Clients that lists are streamed to",
            [(none, shared.client_count())],
        )?;
        let Some((post, posted_at)) = shared.board.newest() else { return Ok(()) };
        let list = &post.list;
        gauges(
            &mut encoder,
            "list_sequence",
            "Sequence number of the newest list",
            [(none, list.stamp.sequence as f64)],
        )?;
        gauges(&mut encoder, "list_lights", "Lights of the newest list", [(none, list.lights.len() as f64)])?;
        if let Some(error) = list.error {
            gauges(&mut encoder, "list_error", "Error of the newest list", [(none, f64::from(error))])?;
        }
        let channels = ["red", "green", "blue"].into_iter().zip(list.power);
        gauges(
            &mut encoder,
            "list_power",
            "Power of the newest list",
            channels.map(|(channel, power)| ([("channel", channel)], power)),
        )?;
        gauges(
            &mut encoder,
            "list_age_seconds",
            "Time since the newest list was made",
            [(none, posted_at.elapsed().as_secs_f64())],
        )
    }
}

fn counters<const N: usize>(
    encoder: &mut DescriptorEncoder,
    name: &str,
    help: &str,
    values: impl IntoIterator<Item = ([(&'static str, &'static str); N], u64)>,
) -> fmt::Result {
    let mut family = encoder.encode_descriptor(name, help, None, MetricType::Counter)?;
    for (labels, value) in values {
        family.encode_family(&labels)?.encode_counter::<[(&str, &str); 0], _, u64>(&value, None)?;
    }
    Ok(())
}

fn gauges<const N: usize, V: EncodeGaugeValue>(
    encoder: &mut DescriptorEncoder,
    name: &str,
    help: &str,
    values: impl IntoIterator<Item = ([(&'static str, &'static str); N], V)>,
) -> fmt::Result {
    let mut family = encoder.encode_descriptor(name, help, None, MetricType::Gauge)?;
    for (labels, value) in values {
        family.encode_family(&labels)?.encode_gauge(&value)?;
    }
    Ok(())
}
