//! `bikebot info`: what is in a recording.

use std::collections::BTreeMap;
use std::path::PathBuf;

use bikebot_sim::record::log::{self, LogInfo};
use clap::Args;
use serde::Serialize;

use crate::exit::{Ending, Exit};
use crate::recording;
use crate::render::{self, Sheet, significant};
use crate::terminal::Terminal;

/// Tell what is in a recording
#[derive(Debug, Args)]
#[command(after_help = "\
Examples:
  bikebot info ride.mcap
  bikebot info ride.mcap --json | jq .metrics.lateral_error_max_m")]
pub struct InfoArgs {
    /// Recording
    #[arg(value_name = "FILE.mcap")]
    pub file: PathBuf,
    /// One JSON object instead of text
    #[arg(long)]
    pub json: bool,
}

/// What `--json` prints. What the recording does not say is absent.
#[derive(Debug, Serialize)]
struct InfoJson<'a> {
    file: String,
    bytes: u64,
    library: &'a str,
    /// The records `bikebot.run` and `bikebot.result`, without the metrics.
    #[serde(flatten)]
    facts: BTreeMap<&'a str, &'a str>,
    #[serde(skip_serializing_if = "Option::is_none")]
    duration_s: Option<f64>,
    messages: u64,
    topics: Vec<TopicJson<'a>>,
    attachments: Vec<AttachmentJson<'a>>,
    metrics: BTreeMap<&'a str, f64>,
    expect: Vec<ExpectJson<'a>>,
    host: BTreeMap<&'a str, &'a str>,
    closed: bool,
    #[serde(skip_serializing_if = "Option::is_none")]
    damage: Option<String>,
}

#[derive(Debug, Serialize)]
struct TopicJson<'a> {
    topic: &'a str,
    schema: &'a str,
    messages: u64,
}

#[derive(Debug, Serialize)]
struct AttachmentJson<'a> {
    name: &'a str,
    bytes: u64,
}

#[derive(Debug, Serialize)]
struct ExpectJson<'a> {
    check: &'a str,
    ok: bool,
}

/// Tells it.
pub fn run(args: &InfoArgs, terminal: &Terminal) -> Ending {
    let mut file = recording::open(&args.file)?;
    let info = log::inspect(&mut file).map_err(|error| recording::tell(&args.file, &error))?;
    let json = describe(render::path(&args.file), &info);
    if args.json {
        terminal.print_json(&json)?;
    } else {
        terminal.print(&sheet(&json))?;
    }
    Ok(Exit::Done)
}

fn describe(file: String, info: &LogInfo) -> InfoJson<'_> {
    let mut json = InfoJson {
        file,
        bytes: info.bytes,
        library: &info.library,
        facts: BTreeMap::new(),
        duration_s: info.span.map(|(first, last)| last.seconds_since(first)),
        messages: info.messages,
        topics: info
            .topics
            .iter()
            .map(|topic| TopicJson {
                topic: &topic.name,
                schema: &topic.schema,
                messages: topic.messages,
            })
            .collect(),
        attachments: info
            .attachments
            .iter()
            .map(|attachment| AttachmentJson {
                name: &attachment.name,
                bytes: attachment.bytes,
            })
            .collect(),
        metrics: BTreeMap::new(),
        expect: Vec::new(),
        host: BTreeMap::new(),
        closed: info.closed,
        damage: info.damage.as_ref().map(ToString::to_string),
    };
    for (key, value) in info.run().into_iter().chain(info.result()).flatten() {
        if let Some(metric) = key.strip_prefix("metrics.") {
            json.metrics
                .extend(value.parse().ok().map(|number| (metric, number)));
        } else if let Some(check) = key.strip_prefix("expect.") {
            json.expect.push(ExpectJson {
                check,
                ok: value == "true",
            });
        } else {
            json.facts.insert(key, value);
        }
    }
    json.host.extend(
        info.host()
            .into_iter()
            .flatten()
            .map(|(key, value)| (key.as_str(), value.as_str())),
    );
    json
}

fn sheet(info: &InfoJson<'_>) -> String {
    let fact = |key: &str| info.facts.get(key).copied();
    let mut sheet = Sheet::new(&info.file, &render::bytes(info.bytes));
    let mut line = |label: &str, parts: &[Option<String>]| {
        sheet.line(label, &parts.iter().flatten().cloned().collect::<Vec<_>>());
    };
    line(
        "run",
        &[
            fact("scenario").map(str::to_owned),
            fact("seed").map(|seed| format!("seed {seed}")),
            fact("plant").map(str::to_owned),
            fact("mode").map(str::to_owned),
            fact("version").map(|version| format!("bikebot {version}")),
        ],
    );
    let set = fact("overrides").unwrap_or_default();
    line(
        "overridden",
        &set.lines()
            .map(|line| Some(line.to_owned()))
            .collect::<Vec<_>>(),
    );
    line(
        "ended",
        &[match (fact("outcome"), fact("reason")) {
            (Some(outcome), Some(reason)) => Some(format!("{outcome} ({reason})")),
            _ => Some("not: the recording was cut, or saved from one that was".into()),
        }],
    );
    line(
        "length",
        &[info
            .duration_s
            .map(|seconds| format!("{} s", significant(seconds)))],
    );
    line("result hash", &[fact("result_hash").map(str::to_owned)]);
    line("damage", std::slice::from_ref(&info.damage));
    for (index, check) in info.expect.iter().enumerate() {
        let verdict = if check.ok { "ok    " } else { "FAILED" };
        let label = if index == 0 { "expected" } else { "" };
        sheet.say(label, format!("{verdict}  {}", check.check));
    }
    if !info.metrics.is_empty() {
        sheet.gap();
        let width = render::column(info.metrics.keys().copied(), 40);
        for (name, value) in &info.metrics {
            sheet.row(&format!("  {name:width$}  {value}"));
        }
    }
    sheet.gap();
    let width = render::column(info.topics.iter().map(|topic| topic.topic), 40);
    for topic in &info.topics {
        sheet.row(&format!(
            "  {:width$}  {:>8}  {}",
            topic.topic, topic.messages, topic.schema
        ));
    }
    if !info.attachments.is_empty() {
        sheet.gap();
        let width = render::column(info.attachments.iter().map(|it| it.name), 40);
        for attachment in &info.attachments {
            sheet.row(&format!(
                "  {:width$}  {}",
                attachment.name,
                render::bytes(attachment.bytes)
            ));
        }
    }
    sheet.finish()
}
