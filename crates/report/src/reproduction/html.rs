//! The page: verdicts, tables and figures in one file that any browser opens without a network.

use std::fmt::Write as _;

use bikebot_sim::study::reproduce::claims::Origin;
use bikebot_sim::study::reproduce::{Judged, Verdict};

use super::{Figure, Reproduction, TO_KNOW, row_words, sign, table1_cells};
use crate::page::{SHEET, colours, escaped};
use crate::palette;
use crate::svg;

const STYLE: &str = include_str!("../../assets/reproduction.css");

/// The whole page.
pub(super) fn page(it: &Reproduction<'_>, figures: &[Figure]) -> String {
    let mut out = String::with_capacity(1_000_000);
    let _ = write!(
        out,
        "<!doctype html>\n<html lang=\"en\">\n<head>\n<meta charset=\"utf-8\">\n\
        <meta name=\"viewport\" content=\"width=device-width, initial-scale=1\">\n\
        <meta http-equiv=\"Content-Security-Policy\" content=\"default-src 'none'; style-src 'unsafe-inline'; img-src data:\">\n\
        <meta name=\"color-scheme\" content=\"light dark\">\n\
        <meta name=\"generator\" content=\"bikebot {}\">\n<title>The paper, measured again · bikebot</title>\n\
        <link rel=\"icon\" href=\"data:,\">\n<style>\n{}</style>\n<style>\n{SHEET}</style>\n<style>\n{STYLE}</style>\n\
        </head>\n<body>\n",
        escaped(it.version),
        colours(),
    );
    head(&mut out, it);
    out.push_str("<main>\n");
    verdict(&mut out, it);
    claims(&mut out, it);
    for figure in figures {
        put_figure(&mut out, figure);
    }
    table1(&mut out);
    table2(&mut out, it);
    again(&mut out, it);
    let _ = write!(
        out,
        "<footer>bikebot {}. The figures depend on scenario, seed and version alone; times on the machine.</footer>\n\
        </main>\n</body>\n</html>\n",
        escaped(it.version)
    );
    out
}

/// Words with code between back-quotes.
fn prose(text: &str) -> String {
    let mut out = String::new();
    for (index, part) in text.split('`').enumerate() {
        if index % 2 == 1 {
            let _ = write!(out, "<code>{}</code>", escaped(part));
        } else {
            out.push_str(&escaped(part));
        }
    }
    out
}

fn head(out: &mut String, it: &Reproduction<'_>) {
    let (runs, rides, seed) = (it.measured.runs, it.measured.rides, it.measured.seed);
    let _ = write!(
        out,
        "<a class=\"skip\" href=\"#claims\">Skip to the claims</a>\n<header class=\"top\">\n<p class=\"brand\">bikebot reproduce</p>\n\
        <h1>The paper, measured again</h1>\n\
        <p class=\"facts\">Yin and Yamakita, path following control of a bike robot by passive velocity field control, SICE 2016 · \
        {runs} {} of every method, {rides} {} of each kind, from seed {seed}</p>\n\
        <nav aria-label=\"On this page\"><a href=\"#claims\">Claims</a> <a href=\"#fig5\">Fig. 5</a> <a href=\"#fig6\">6</a> \
        <a href=\"#fig7\">7</a> <a href=\"#fig8\">8</a> <a href=\"#table1\">Table 1</a> <a href=\"#table2\">2</a> \
        <a href=\"#again\">Commands</a></nav>\n</header>\n",
        if runs == 1 { "run" } else { "runs" },
        if rides == 1 { "ride" } else { "rides" },
    );
}

fn tone(verdict: Verdict) -> &'static str {
    match verdict {
        Verdict::Holds => "good",
        Verdict::Differs => "care",
        Verdict::Fails => "bad",
        Verdict::NotMeasured => "plain",
    }
}

fn verdict(out: &mut String, it: &Reproduction<'_>) {
    let fails = it.count(Verdict::Fails) > 0;
    let (class, sign) = if fails {
        ("bad", "✕")
    } else {
        ("good", "✓")
    };
    let sentence = it.sentence();
    let _ = write!(
        out,
        "<section id=\"verdict\" class=\"verdict {class}\" aria-labelledby=\"outcome\">\n\
        <div class=\"outcome\"><span class=\"sign\" aria-hidden=\"true\">{sign}</span>\n<div>\n\
        <h2 id=\"outcome\">{}.</h2>\n<ul class=\"know\">\n",
        escaped(&sentence)
    );
    for text in TO_KNOW {
        let _ = writeln!(out, "<li>{}</li>", prose(text));
    }
    out.push_str("</ul>\n</div></div>\n</section>\n");
}

fn claims(out: &mut String, it: &Reproduction<'_>) {
    for (id, origin, title) in [
        ("claims", Origin::Paper, "The paper's claims"),
        ("beyond", Origin::Ours, "Beyond the paper"),
    ] {
        let _ = write!(
            out,
            "<section id=\"{id}\"><h2>{title}</h2>\n<table class=\"claims\">\n<thead><tr><th scope=\"col\">Verdict</th>\
            <th scope=\"col\">Claim</th><th scope=\"col\">Ours</th><th scope=\"col\">Paper</th></tr></thead>\n<tbody>\n"
        );
        for judged in it.judged.iter().filter(|judged| judged.origin == origin) {
            claim(out, judged);
        }
        out.push_str("</tbody>\n</table>\n</section>\n");
    }
}

fn claim(out: &mut String, judged: &Judged) {
    let verdict = judged.verdict;
    let finding = judged.finding.as_ref();
    let ours = finding.map_or("–", |it| it.ours.as_str());
    let paper = finding.map_or("", |it| it.paper.as_str());
    let _ = write!(
        out,
        "<tr id=\"{0}\" class=\"{1}\"><td class=\"chip\"><span><b aria-hidden=\"true\">{2}</b> {3}</span></td>\
        <td class=\"claim\"><p>{4}</p><small>{5}</small>",
        judged.id,
        tone(verdict),
        sign(verdict),
        verdict.word(),
        prose(judged.claim),
        escaped(judged.source),
    );
    if let Some(difference) = judged.difference {
        let _ = write!(out, "<p class=\"why\">{}</p>", prose(difference));
    }
    out.push_str("<details><summary>How it is judged</summary>");
    let _ = write!(out, "<p>Holds if: {}.</p>", prose(judged.criterion));
    if !judged.remark.is_empty() {
        let _ = write!(out, "<p>{}</p>", prose(judged.remark));
    }
    let _ = write!(
        out,
        "<pre tabindex=\"0\"><code>{}</code></pre></details></td><td class=\"ours\" data-name=\"ours\"><div>{}</div></td>",
        escaped(&judged.command),
        prose(ours)
    );
    let paper = if paper.is_empty() { "–" } else { paper };
    let _ = writeln!(
        out,
        "<td class=\"paper\" data-name=\"paper\"><div>{}</div></td></tr>",
        prose(paper)
    );
}

fn put_figure(out: &mut String, figure: &Figure) {
    let _ = write!(
        out,
        "<section id=\"{0}\"><h2>{1}</h2>\n<figure>\n<div class=\"wide\" tabindex=\"0\" role=\"group\" aria-label=\"{1}\">{2}</div>\n\
        <figcaption>{3} <a href=\"{0}.svg\">{0}.svg</a>, <a href=\"{0}.png\">{0}.png</a></figcaption>\n</figure>\n\
        <details><summary>Draw it again</summary><pre tabindex=\"0\"><code>{4}</code></pre></details>\n</section>\n",
        figure.name,
        escaped(figure.title),
        themed(&svg::write(&figure.drawing)),
        escaped(&figure.caption),
        escaped(&figure.commands.join("\n")),
    );
}

/// A picture whose colours are those of the page, so that it is dark where the page is.
fn themed(picture: &str) -> String {
    let mut text = picture.to_owned();
    for (name, colour) in palette::NAMED {
        text = text.replace(&format!("\"{}\"", colour.0), &format!("\"var(--{name})\""));
    }
    text
}

fn table1(out: &mut String) {
    let (headings, rows) = table1_cells();
    out.push_str("<section id=\"table1\"><h2>Table 1: parameters</h2>\n<div class=\"wide\" tabindex=\"0\" role=\"group\" aria-label=\"Table 1\">\n<table class=\"numbers\">\n<thead><tr>");
    for heading in headings {
        let _ = write!(out, "<th scope=\"col\">{heading}</th>");
    }
    out.push_str("</tr></thead>\n<tbody>\n");
    for [symbol, is, ours, paper, remark] in rows {
        let class = if paper != "–" && paper != ours {
            " class=\"care\""
        } else {
            ""
        };
        let _ = writeln!(
            out,
            "<tr{class}><th scope=\"row\"><i>{}</i></th><td class=\"words\">{}</td><td>{}</td><td>{}</td><td class=\"words\">{}</td></tr>",
            escaped(&symbol),
            escaped(&is),
            escaped(&ours),
            escaped(&paper),
            prose(&remark)
        );
    }
    out.push_str("</tbody>\n</table>\n</div>\n</section>\n");
}

fn table2(out: &mut String, it: &Reproduction<'_>) {
    let table = &it.measured.table2;
    out.push_str(
        "<section id=\"table2\"><h2>Table 2: methods on one field</h2>\n<div class=\"wide\" tabindex=\"0\" role=\"group\" aria-label=\"Table 2\">\n<table class=\"numbers\">\n\
        <thead><tr><th rowspan=\"2\" scope=\"col\">method</th><th colspan=\"2\" scope=\"colgroup\">length, m</th>\
        <th colspan=\"3\" scope=\"colgroup\">roughness, 1/m⁵</th><th colspan=\"2\" scope=\"colgroup\">curvature, 1/m</th>\
        <th colspan=\"2\" scope=\"colgroup\">time</th><th rowspan=\"2\" scope=\"col\">found</th></tr>\n\
        <tr><th scope=\"col\">ours</th><th scope=\"col\">paper</th><th scope=\"col\">ours</th><th scope=\"col\">paper</th>\
        <th scope=\"col\">at 0.5 m</th><th scope=\"col\">most</th><th scope=\"col\">jump</th><th scope=\"col\">ours</th>\
        <th scope=\"col\">paper</th></tr></thead>\n<tbody>\n",
    );
    for (row, cells) in table.rows.iter().zip(table.cells()) {
        let _ = write!(
            out,
            "<tr><th scope=\"row\">{}<small><code>{}</code></small></th>",
            escaped(&row_words(row)),
            escaped(row.method)
        );
        // The first cell is the name.
        for cell in cells.iter().skip(1) {
            let cell = if cell == "-" { "–" } else { cell.as_str() };
            let _ = write!(out, "<td>{}</td>", escaped(cell));
        }
        out.push_str("</tr>\n");
    }
    out.push_str("</tbody>\n</table>\n</div>\n<ul class=\"know\">\n");
    for note in table.notes(true) {
        let _ = writeln!(out, "<li>{}</li>", prose(&note));
    }
    out.push_str("</ul>\n</section>\n");
}

fn again(out: &mut String, it: &Reproduction<'_>) {
    let _ = writeln!(
        out,
        "<section id=\"again\"><h2>Measure it again</h2>\n\
        <p>The scenarios and their maps lie beside this page, in <code>scenarios/</code>; every command above works from this folder. All of it:</p>\n\
        <pre tabindex=\"0\"><code>{}</code></pre>\n</section>",
        escaped(it.again)
    );
}
