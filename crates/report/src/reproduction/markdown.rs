//! The same in Markdown.

use std::fmt::Write as _;

use bikebot_sim::study::reproduce::claims::Origin;

use super::{Figure, Reproduction, TO_KNOW, sign, table1_cells};

/// The whole page.
pub(super) fn page(it: &Reproduction<'_>, figures: &[Figure]) -> String {
    let (runs, rides, seed) = (it.measured.runs, it.measured.rides, it.measured.seed);
    let mut out = format!(
        "# The paper, measured again\n\n\
        Yin and Yamakita, path following control of a bike robot by passive velocity field control, SICE 2016; {runs} {} of every method, {rides} {} of each kind, from seed {seed}.\n\n\
        **{}.**\n\n",
        if runs == 1 { "run" } else { "runs" },
        if rides == 1 { "ride" } else { "rides" },
        it.sentence(),
    );
    for text in TO_KNOW {
        let _ = writeln!(out, "* {text}");
    }
    for (origin, title) in [
        (Origin::Paper, "The paper's claims"),
        (Origin::Ours, "Beyond the paper"),
    ] {
        let _ = write!(
            out,
            "\n## {title}\n\n| verdict | claim | ours | paper | source |\n|---|---|---|---|---|\n"
        );
        let rows = || it.judged.iter().filter(|judged| judged.origin == origin);
        for judged in rows() {
            let finding = judged.finding.as_ref();
            let _ = writeln!(
                out,
                "| {} {} | {} | {} | {} | {} |",
                sign(judged.verdict),
                judged.verdict.word(),
                cell(judged.claim),
                cell(finding.map_or("–", |it| &it.ours)),
                cell(finding.map_or("–", |it| &it.paper)),
                cell(judged.source),
            );
        }
        out.push('\n');
        for judged in rows() {
            let _ = writeln!(
                out,
                "* **{}** Holds if: {}.",
                judged.claim, judged.criterion
            );
            for text in judged.difference.into_iter().chain([judged.remark]) {
                if !text.is_empty() {
                    let _ = writeln!(out, "  {text}");
                }
            }
            let _ = writeln!(out, "  `{}`", judged.command.replace('`', "'"));
        }
    }
    for figure in figures {
        let _ = write!(
            out,
            "\n## {}\n\n![{}]({}.svg)\n\n{}\n\n```sh\n{}\n```\n",
            figure.title,
            figure.title,
            figure.name,
            figure.caption,
            figure.commands.join("\n")
        );
    }
    let (headings, rows) = table1_cells();
    let _ = write!(
        out,
        "\n## Table 1: parameters\n\n| {} |\n|---|---|---|---|---|\n",
        headings.join(" | ")
    );
    for row in rows {
        let cells = row.map(|text| cell(&text));
        let _ = writeln!(out, "| {} |", cells.join(" | "));
    }
    let _ = write!(
        out,
        "\n## Table 2: methods on one field\n\n{}\n## Measure it again\n\n\
        The scenarios and their maps lie beside this file, in `scenarios/`; every command works from this folder. All of it:\n\n\
        ```sh\n{}\n```\n",
        it.measured.table2.to_markdown(true),
        it.again
    );
    out
}

/// Text in a cell of a table.
fn cell(text: &str) -> String {
    if text.is_empty() {
        "–".into()
    } else {
        text.replace('|', "\\|").replace('\n', " ")
    }
}
