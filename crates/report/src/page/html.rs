//! The page itself: words, tables, and the script and numbers that bring it to life.

use std::fmt::Write as _;

use super::verdict::{CURVATURE, Margin, Verdict};
use super::{PageData, Ride, Tone, grade, number};
use crate::palette;

/// Most events of a ride that are listed.
pub(super) const MAX_EVENTS: usize = 400;
/// Most lines of a ride's log that are listed.
const MAX_LINES: usize = 400;

/// The sheet of all our pages.
pub(crate) const SHEET: &str = include_str!("../../assets/report.css");
const SCRIPT: &str = include_str!("../../assets/report.js");
const CHART_STYLE: &str = include_str!("../../assets/uplot/uPlot.min.css");
const CHART_SCRIPT: &str = include_str!("../../assets/uplot/uPlot.iife.min.js");
const CHART_LICENCE: &str = include_str!("../../assets/uplot/LICENSE");

/// Text that may stand anywhere in the page.
pub(crate) fn escaped(text: &str) -> String {
    let mut out = String::with_capacity(text.len());
    for c in text.chars() {
        match c {
            '&' => out.push_str("&amp;"),
            '<' => out.push_str("&lt;"),
            '>' => out.push_str("&gt;"),
            '"' => out.push_str("&quot;"),
            '\'' => out.push_str("&#39;"),
            // Other control characters are no part of a page.
            c if c.is_control() && !matches!(c, '\n' | '\t') => out.push('\u{fffd}'),
            c => out.push(c),
        }
    }
    out
}

/// A word of a command line, quoted where a shell would not leave it alone.
fn shell_word(word: &str) -> String {
    let is_plain = |c: char| c.is_ascii_alphanumeric() || "-_./+:@%,".contains(c);
    if !word.is_empty() && word.chars().all(is_plain) {
        word.to_owned()
    } else {
        format!("'{}'", word.replace('\'', "'\\''"))
    }
}

/// The whole page.
pub(super) fn page(rides: &[Ride<'_>], data: &PageData, version: &str) -> String {
    // In a script element only `<` could end it; inside JSON it stands in strings alone.
    let numbers = serde_json::to_string(data)
        .unwrap_or_else(|_| "null".into())
        .replace('<', "\\u003c");
    let names: Vec<&str> = rides.iter().map(|ride| ride.name.as_str()).collect();
    let title = match rides {
        [ride] => format!("{}: {}", ride.name, ride.verdict.headline.to_lowercase()),
        _ => names.join(" and "),
    };
    let mut out = String::with_capacity(numbers.len() + 200_000);
    let _ = write!(
        out,
        "<!doctype html>\n<html lang=\"en\">\n<head>\n<meta charset=\"utf-8\">\n\
        <meta name=\"viewport\" content=\"width=device-width, initial-scale=1\">\n\
        <meta http-equiv=\"Content-Security-Policy\" content=\"default-src 'none'; style-src 'unsafe-inline'; \
        script-src 'unsafe-inline'; img-src data:\">\n\
        <meta name=\"color-scheme\" content=\"light dark\">\n\
        <meta name=\"generator\" content=\"bikebot {}\">\n<title>{} · bikebot report</title>\n\
        <link rel=\"icon\" href=\"data:,\">\n<style>\n{}</style>\n<style>{CHART_STYLE}</style>\n<style>\n{SHEET}</style>\n\
        </head>\n<body>\n",
        escaped(version),
        escaped(&title),
        colours(),
    );
    head(&mut out, rides);
    out.push_str("<main>\n");
    for ride in rides {
        banner(&mut out, ride, rides.len() > 1);
    }
    match rides {
        [ride] => verdict(&mut out, ride),
        _ => comparison(&mut out, rides),
    }
    out.push_str(include_str!("../../assets/ride.html"));
    events(&mut out, rides);
    scenarios(&mut out, rides);
    again(&mut out, rides);
    foot(&mut out, rides, version);
    out.push_str("</main>\n");
    out.push_str(include_str!("../../assets/transport.html"));
    let _ = write!(
        out,
        "<script type=\"application/json\" id=\"numbers\">{numbers}</script>\n\
        <script>/*! uPlot, MIT licence:\n{CHART_LICENCE}*/\n{CHART_SCRIPT}</script>\n<script>\n{SCRIPT}</script>\n</body>\n</html>\n"
    );
    out
}

/// The palette of the figures as variables of the style sheet.
pub(crate) fn colours() -> String {
    let lines = palette::NAMED.map(|(name, colour)| format!("  --{name}: {};\n", colour.0));
    format!(":root {{\n{}}}\n", lines.concat())
}

fn head(out: &mut String, rides: &[Ride<'_>]) {
    out.push_str("<a class=\"skip\" href=\"#ride\">Skip to the ride</a>\n<header class=\"top\">\n");
    let of = |ride: &Ride<'_>| {
        let run = ride.recording.info.run();
        let entry = |key: &str| run.and_then(|it| it.get(key)).cloned();
        let facts = [
            entry("seed").map(|seed| format!("seed {seed}")),
            entry("plant"),
            entry("mode"),
            Some(format!("{} s", number(ride.end))).filter(|_| ride.end > 0.0),
        ];
        facts.into_iter().flatten().collect::<Vec<_>>().join(" · ")
    };
    match rides {
        [ride] => {
            let _ = writeln!(
                out,
                "<p class=\"brand\">bikebot report</p>\n<h1>{}</h1>\n<p class=\"facts\">{}</p>",
                escaped(&ride.name),
                escaped(&of(ride))
            );
        }
        _ => {
            let _ = writeln!(
                out,
                "<p class=\"brand\">bikebot report</p>\n<h1>{} rides side by side</h1>",
                rides.len()
            );
        }
    }
    out.push_str("</header>\n");
}

fn banner(out: &mut String, ride: &Ride<'_>, is_one_of_many: bool) {
    let mut texts = ride.recording.missing.clone();
    if ride.rows.every > 1 {
        texts.push(format!(
            "The histories show every {}th sample of the recording; the figures of the verdict are of all of them.",
            ride.rows.every
        ));
    }
    if texts.is_empty() {
        return;
    }
    out.push_str("<section class=\"banner\" role=\"status\" aria-label=\"What is missing\">\n");
    if is_one_of_many {
        let _ = writeln!(out, "<h2>{}</h2>", escaped(&ride.recording.file));
    }
    out.push_str("<ul>\n");
    for text in texts {
        let _ = writeln!(out, "<li>{}</li>", escaped(&text));
    }
    out.push_str("</ul>\n</section>\n");
}

/// Class and sign of a tone: the sign tells it without colour.
fn tone(tone: Tone) -> (&'static str, &'static str) {
    match tone {
        Tone::Good => ("good", "✓"),
        Tone::Expected => ("care", "✓"),
        Tone::Bad => ("bad", "✕"),
        Tone::Open => ("plain", "?"),
    }
}

fn verdict(out: &mut String, ride: &Ride<'_>) {
    let it = &ride.verdict;
    let (class, sign) = tone(it.tone);
    let _ = writeln!(
        out,
        "<section id=\"verdict\" class=\"verdict {class}\" aria-labelledby=\"outcome\">\n\
        <div class=\"outcome\"><span class=\"sign\" aria-hidden=\"true\">{sign}</span>\n<div>\n<h2 id=\"outcome\">{}</h2>",
        escaped(&it.headline)
    );
    for text in &it.why {
        let _ = writeln!(out, "<p>{}</p>", escaped(text));
    }
    out.push_str("</div></div>\n");
    if !it.metrics_are_recorded && !it.margins.is_empty() {
        out.push_str("<p class=\"aside\">Counted from what was recorded until it broke off.</p>\n");
    }
    margins(out, &it.margins);
    expectations(out, it);
    out.push_str("</section>\n");
}

fn margins(out: &mut String, margins: &[Margin]) {
    if margins.is_empty() {
        return;
    }
    out.push_str("<dl class=\"margins\">\n");
    for margin in margins {
        let class = match (margin.kept, margin.used) {
            (Some(false), _) => "bad",
            (_, Some(used)) if used > 0.8 && margin.name != CURVATURE => "care",
            _ => "good",
        };
        let _ = write!(
            out,
            "<div class=\"{class}\"><dt>{}</dt><dd><b>{}</b>",
            escaped(margin.name),
            escaped(&margin.value)
        );
        if let Some(used) = margin.used {
            let _ = write!(
                out,
                "<span class=\"bar\" aria-hidden=\"true\"><i style=\"width:{:.1}%\"></i></span>",
                (100.0 * used).clamp(0.0, 100.0)
            );
        }
        let sign = if margin.kept == Some(false) {
            "✕ "
        } else {
            ""
        };
        let _ = writeln!(
            out,
            "<small>{sign}{}</small></dd></div>",
            escaped(&margin.limit)
        );
    }
    out.push_str("</dl>\n");
}

fn expectations(out: &mut String, verdict: &Verdict) {
    if verdict.expected.is_empty() {
        return;
    }
    let failed = verdict.expected.iter().filter(|check| !check.1).count();
    let count = verdict.expected.len();
    let summary = match (failed, count) {
        (0, 1) => "The scenario's one expectation holds".to_owned(),
        (0, _) => format!("All {count} expectations of the scenario hold"),
        (_, 1) => "The scenario's one expectation failed".to_owned(),
        _ => format!("{failed} of {count} expectations of the scenario failed"),
    };
    let open = if failed > 0 { " open" } else { "" };
    let _ = writeln!(
        out,
        "<details class=\"expected\"{open}><summary>{summary}</summary>\n<ul>"
    );
    for (check, ok) in &verdict.expected {
        let (class, sign) = if *ok { ("good", "✓") } else { ("bad", "✕") };
        let said = if *ok { "holds" } else { "failed" };
        let _ = writeln!(
            out,
            "<li class=\"{class}\"><span class=\"sign\" role=\"img\" aria-label=\"{said}\">{sign}</span> {}</li>",
            escaped(check)
        );
    }
    out.push_str("</ul></details>\n");
}

/// Several rides: a column each.
fn comparison(out: &mut String, rides: &[Ride<'_>]) {
    out.push_str(
        "<section id=\"verdict\" class=\"verdict\" aria-label=\"Verdicts\">\n<div class=\"wide\" tabindex=\"0\">\n<table class=\"compare\">\n<thead><tr><td></td>",
    );
    for (index, ride) in rides.iter().enumerate() {
        let _ = write!(
            out,
            "<th scope=\"col\"><span class=\"swatch ride-{}\" aria-hidden=\"true\"></span>{}<small>{}</small></th>",
            index % 6,
            escaped(&ride.name),
            escaped(&ride.recording.file)
        );
    }
    out.push_str("</tr></thead>\n<tbody>\n");
    let row = |out: &mut String, name: &str, aside: &str, cells: Vec<(String, &str)>| {
        let _ = write!(
            out,
            "<tr><th scope=\"row\">{}<small>{}</small></th>",
            escaped(name),
            escaped(aside)
        );
        for (text, class) in cells {
            let _ = write!(out, "<td class=\"{class}\">{text}</td>");
        }
        out.push_str("</tr>\n");
    };
    let outcomes = rides.iter().map(|ride| {
        let (class, sign) = tone(ride.verdict.tone);
        let headline = escaped(&ride.verdict.headline);
        let why = ride
            .verdict
            .why
            .first()
            .map(|it| escaped(it))
            .unwrap_or_default();
        (
            format!("<b>{sign} {headline}</b><small>{why}</small>"),
            class,
        )
    });
    row(out, "Ended", "", outcomes.collect());
    let mut names: Vec<&str> = Vec::new();
    for margin in rides.iter().flat_map(|ride| &ride.verdict.margins) {
        if !names.contains(&margin.name) {
            names.push(margin.name);
        }
    }
    for name in names {
        let found: Vec<Option<&Margin>> = rides
            .iter()
            .map(|ride| ride.verdict.margins.iter().find(|it| it.name == name))
            .collect();
        // A limit that all share stands with the name, once.
        let mut limits = found.iter().flatten().map(|it| it.limit.as_str());
        let first = limits.next().unwrap_or_default();
        let shared = limits.all(|it| it == first);
        let cells = found.iter().map(|it| match it {
            Some(it) => {
                let class = if it.kept == Some(false) { "bad" } else { "" };
                let limit = if shared {
                    String::new()
                } else {
                    format!("<small>{}</small>", escaped(&it.limit))
                };
                (format!("{}{limit}", escaped(&it.value)), class)
            }
            None => ("–".to_owned(), "none"),
        });
        row(out, name, if shared { first } else { "" }, cells.collect());
    }
    for (name, key, unit) in [
        ("Time", "time_s", "s"),
        ("Way", "distance_m", "m"),
        ("Top speed", "speed_max_mps", "m/s"),
        ("Plans made while riding", "replans", ""),
        ("Work of the drive", "drive_work_j", "J"),
        ("Work of the balancer", "balancer_work_j", "J"),
    ] {
        if rides
            .iter()
            .any(|ride| ride.verdict.metrics.contains_key(key))
        {
            let cells = rides
                .iter()
                .map(|ride| match ride.verdict.metrics.get(key) {
                    Some(value) => (format!("{} {unit}", number(*value)), ""),
                    None => ("–".to_owned(), "none"),
                });
            row(out, name, "", cells.collect());
        }
    }
    out.push_str("</tbody></table>\n</div>\n</section>\n");
}

fn events(out: &mut String, rides: &[Ride<'_>]) {
    let count: usize = rides
        .iter()
        .map(|ride| ride.recording.trace.notices.len())
        .sum();
    let lines: usize = rides
        .iter()
        .map(|ride| ride.recording.trace.lines.len())
        .sum();
    out.push_str("<section id=\"events\" aria-labelledby=\"events-name\">\n<h2 id=\"events-name\">Events</h2>\n");
    if count == 0 {
        out.push_str("<p class=\"aside\">Nothing of note was recorded.</p>\n");
    }
    for (index, ride) in rides.iter().enumerate() {
        let notices = &ride.recording.trace.notices;
        if notices.is_empty() {
            continue;
        }
        if rides.len() > 1 {
            let _ = writeln!(
                out,
                "<h3><span class=\"swatch ride-{}\" aria-hidden=\"true\"></span>{}</h3>",
                index % 6,
                escaped(&ride.name)
            );
        }
        out.push_str("<ol class=\"events\">\n");
        for notice in notices.iter().take(MAX_EVENTS) {
            let time = if notice.time_s.is_finite() {
                notice.time_s
            } else {
                0.0
            };
            let _ = writeln!(
                out,
                "<li><button type=\"button\" data-time=\"{time}\"><span class=\"when\">{time:.2} s</span> <span class=\"kind {}\">{}</span> <span class=\"text\">{}</span></button></li>",
                grade(&notice.kind),
                escaped(&notice.kind.replace('_', " ")),
                escaped(&notice.text)
            );
        }
        out.push_str("</ol>\n");
        if notices.len() > MAX_EVENTS {
            let _ = writeln!(
                out,
                "<p class=\"aside\">… and {} more.</p>",
                notices.len() - MAX_EVENTS
            );
        }
    }
    if lines > 0 {
        let _ = writeln!(
            out,
            "<details><summary>Log, {lines} line{}</summary>",
            if lines == 1 { "" } else { "s" }
        );
        for ride in rides {
            if rides.len() > 1 {
                let _ = writeln!(out, "<h3>{}</h3>", escaped(&ride.name));
            }
            out.push_str("<ol class=\"events\">\n");
            for line in ride.recording.trace.lines.iter().take(MAX_LINES) {
                let level = format!("{:?}", line.level).to_lowercase();
                let class = match level.as_str() {
                    "error" => "bad",
                    "warning" => "care",
                    _ => "plain",
                };
                let _ = writeln!(
                    out,
                    "<li><button type=\"button\" data-time=\"{0}\"><span class=\"when\">{0:.2} s</span> <span class=\"kind {class}\">{level}</span> <span class=\"text\">{1}</span></button></li>",
                    line.time_s,
                    escaped(&line.text)
                );
            }
            out.push_str("</ol>\n");
        }
        out.push_str("</details>\n");
    }
    out.push_str("</section>\n");
}

fn scenarios(out: &mut String, rides: &[Ride<'_>]) {
    out.push_str("<section id=\"scenario\" aria-labelledby=\"scenario-name\">\n<h2 id=\"scenario-name\">Scenario</h2>\n");
    for (index, ride) in rides.iter().enumerate() {
        let run = ride.recording.info.run();
        let overrides = run
            .and_then(|run| run.get("overrides"))
            .map_or("", String::as_str);
        if rides.len() > 1 {
            let _ = writeln!(
                out,
                "<h3><span class=\"swatch ride-{}\" aria-hidden=\"true\"></span>{}</h3>",
                index % 6,
                escaped(&ride.name)
            );
        }
        if !overrides.is_empty() {
            let list: Vec<String> = overrides
                .lines()
                .map(|it| format!("<code>{}</code>", escaped(it)))
                .collect();
            let _ = writeln!(
                out,
                "<p class=\"aside\">Set on the command line, and already in the text: {}</p>",
                list.join(", ")
            );
        }
        match ride.recording.scenario_text {
            Some(text) => {
                let _ = writeln!(
                    out,
                    "<div class=\"text\"><button type=\"button\" class=\"copy\" data-copy=\"scenario-{index}\">Copy</button>\
                    <pre id=\"scenario-{index}\" tabindex=\"0\" aria-label=\"Scenario, TOML\">{}</pre></div>",
                    escaped(text)
                );
            }
            None => out.push_str("<p class=\"aside\">The recording carries none.</p>\n"),
        }
    }
    out.push_str("</section>\n");
}

fn again(out: &mut String, rides: &[Ride<'_>]) {
    out.push_str("<section id=\"again\" aria-labelledby=\"again-name\">\n<h2 id=\"again-name\">The same ride again</h2>\n");
    for (index, ride) in rides.iter().enumerate() {
        let file = shell_word(&ride.recording.file);
        if ride.recording.scenario_text.is_some() {
            let _ = writeln!(
                out,
                "<div class=\"text\"><button type=\"button\" class=\"copy\" data-copy=\"again-{index}\">Copy</button>\
                <pre id=\"again-{index}\" tabindex=\"0\">bikebot run --from {}</pre></div>",
                escaped(&file)
            );
        }
    }
    out.push_str("<p class=\"aside\">Bit for bit the same with the same version: the result hash tells.</p>\n");
    for ride in rides {
        let mut facts: Vec<(String, String)> = vec![("file".into(), ride.recording.file.clone())];
        for (key, label) in [
            ("version", "bikebot"),
            ("scenario", "scenario"),
            ("seed", "seed"),
            ("plant", "plant"),
            ("mode", "mode"),
            ("run_id", "run id"),
            ("scenario_sha256", "scenario SHA-256"),
        ] {
            let value = ride.recording.info.run().and_then(|run| run.get(key));
            facts.extend(value.map(|value| (label.to_owned(), value.clone())));
        }
        let hash = ride
            .recording
            .info
            .result()
            .and_then(|it| it.get("result_hash"));
        facts.extend(hash.map(|hash| ("result hash".to_owned(), hash.clone())));
        out.push_str("<dl class=\"facts\">\n");
        for (name, value) in facts {
            let _ = writeln!(
                out,
                "<div><dt>{}</dt><dd>{}</dd></div>",
                escaped(&name),
                escaped(&value)
            );
        }
        out.push_str("</dl>\n");
    }
    out.push_str("</section>\n<section id=\"metrics\">\n<details><summary>Every metric</summary>\n<div class=\"wide\" tabindex=\"0\"><table class=\"metrics\">\n");
    let mut names: Vec<&String> = rides
        .iter()
        .flat_map(|ride| ride.verdict.metrics.keys())
        .collect();
    names.sort();
    names.dedup();
    for name in names {
        let _ = write!(
            out,
            "<tr><th scope=\"row\"><code>{}</code></th>",
            escaped(name)
        );
        for ride in rides {
            let value = ride.verdict.metrics.get(name);
            let _ = write!(out, "<td>{}</td>", value.map_or("–".into(), f64::to_string));
        }
        out.push_str("</tr>\n");
    }
    out.push_str("</table></div></details>\n</section>\n");
}

fn foot(out: &mut String, rides: &[Ride<'_>], version: &str) {
    let files: Vec<String> = rides
        .iter()
        .map(|ride| shell_word(&ride.recording.file))
        .collect();
    let _ = writeln!(
        out,
        "<footer>\n<p>Made by bikebot {} with <code>bikebot report {}</code>. Numbers that are drawn are rounded to 1/65 534 of their range, \
        or to seven digits; times and the figures of the verdict are exact.</p>\n\
        <p>Charts by <a href=\"https://github.com/leeoniya/uPlot\">uPlot</a> (MIT). This page asks the network for nothing.</p>\n</footer>",
        escaped(version),
        escaped(&files.join(" "))
    );
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn nothing_that_is_escaped_can_end_what_it_stands_in() {
        assert_eq!(
            escaped("</script><b a=\"'&\u{7}\n"),
            "&lt;/script&gt;&lt;b a=&quot;&#39;&amp;\u{fffd}\n"
        );
    }

    #[test]
    fn words_of_a_command_line_are_quoted_where_they_must_be() {
        assert_eq!(shell_word("fig7-1.mcap"), "fig7-1.mcap");
        assert_eq!(shell_word("my ride.mcap"), "'my ride.mcap'");
        assert_eq!(shell_word("it's; rm -rf ~"), "'it'\\''s; rm -rf ~'");
    }

    #[test]
    fn no_script_of_ours_holds_what_would_end_it() {
        for script in [SCRIPT, CHART_SCRIPT, CHART_LICENCE] {
            let low = script.to_lowercase();
            assert!(!low.contains("</script") && !low.contains("<!--"));
        }
        assert!(!CHART_LICENCE.contains("*/"));
        for style in [SHEET, CHART_STYLE] {
            assert!(!style.to_lowercase().contains("</style"));
        }
    }
}
