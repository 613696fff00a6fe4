//! `bikebot man`.

use std::path::PathBuf;

use clap::{Args, Command, CommandFactory};
use clap_mangen::Man;

use crate::args::{Cli, Force};
use crate::diag::Diagnostic;
use crate::exit::{Ending, Exit, Failure};
use crate::output::{Output, make_folder};
use crate::render;
use crate::terminal::Terminal;

/// Print the manual page, or write those of all verbs
///
/// Without a verb it is the page of the whole program, bikebot(1). With -o the pages of
/// all verbs are written into a folder: bikebot.1, bikebot-run.1, bikebot-plan.1 and so on.
#[derive(Debug, Args)]
#[command(after_help = "\
Examples:
  bikebot man | man -l -
  bikebot man run > bikebot-run.1
  bikebot man -o ~/.local/share/man/man1")]
pub struct ManArgs {
    /// The verb whose page to print: run, plan, 'map info', … [default: the whole program]
    #[arg(value_name = "VERB", conflicts_with = "output", num_args = 0..=2)]
    pub verb: Vec<String>,
    /// Write the pages of all verbs into this folder, made if it is not there
    #[arg(short, long, value_name = "DIR")]
    pub output: Option<PathBuf>,
    #[command(flatten)]
    pub force: Force,
}

/// Prints or writes.
pub fn run(args: &ManArgs, terminal: &Terminal) -> Ending {
    let program = program();
    let Some(folder) = &args.output else {
        let mut command = &program;
        for name in &args.verb {
            command = command.find_subcommand(name).ok_or_else(|| {
                Failure::usage(
                    Diagnostic::error(format!("there is no verb `{}`", args.verb.join(" ")))
                        .help("`bikebot help` lists them"),
                )
            })?;
        }
        terminal.print(&String::from_utf8_lossy(&page(command)?))?;
        return Ok(Exit::Done);
    };
    make_folder(folder)?;
    let mut pages = Vec::new();
    collect(&program, &mut pages)?;
    for (name, page) in &pages {
        Output::create(&folder.join(name), args.force.force)?.write_all(page)?;
    }
    terminal.remark(&format!(
        "wrote {} to {}",
        render::count(pages.len() as u64, "page"),
        render::path(folder)
    ));
    Ok(Exit::Done)
}

/// The command with the full names of its verbs (`bikebot-map-info`), and without `help`, which is no page.
fn program() -> Command {
    let mut program = Cli::command().disable_help_subcommand(true);
    program.build();
    program
}

fn collect(command: &Command, pages: &mut Vec<(String, Vec<u8>)>) -> Result<(), Failure> {
    let name = command
        .get_display_name()
        .unwrap_or_else(|| command.get_name());
    pages.push((format!("{name}.1"), page(command)?));
    for verb in command.get_subcommands() {
        collect(verb, pages)?;
    }
    Ok(())
}

fn page(command: &Command) -> Result<Vec<u8>, Failure> {
    let mut page = Vec::new();
    Man::new(command.clone())
        .source(format!("bikebot {}", env!("CARGO_PKG_VERSION")))
        .manual("bikebot")
        .render(&mut page)
        .map_err(|error| Failure::stdout(&error))?;
    Ok(with_examples(&String::from_utf8_lossy(&page)).into_bytes())
}

/// What follows the flags in the help is called EXTRA and filled to the margin, so that no example could be copied from it: here it is EXAMPLES,
/// line for line.
fn with_examples(page: &str) -> String {
    const EXTRA: &str = ".SH EXTRA\nExamples:\n";
    let Some((head, rest)) = page.split_once(EXTRA) else {
        return page.to_owned();
    };
    let (examples, tail) = rest.split_at(rest.find("\n.SH ").map_or(rest.len(), |at| at + 1));
    format!("{head}.SH EXAMPLES\n.nf\n{examples}.fi\n{tail}")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn examples_keep_their_lines() {
        let page = ".SH OPTIONS\nx\n.SH EXTRA\nExamples:\n  a\n  b\n.SH VERSION\n1\n";
        let with = ".SH OPTIONS\nx\n.SH EXAMPLES\n.nf\n  a\n  b\n.fi\n.SH VERSION\n1\n";
        assert_eq!(with_examples(page), with);
        let last = ".SH EXTRA\nExamples:\n  a\n";
        assert_eq!(with_examples(last), ".SH EXAMPLES\n.nf\n  a\n.fi\n");
        assert_eq!(with_examples(".SH NAME\n"), ".SH NAME\n");
    }
}
