//! `bikebot completions SHELL`.

use clap::{Args, CommandFactory};
use clap_complete::Shell;

use crate::args::Cli;
use crate::exit::{Ending, Exit};
use crate::terminal::Terminal;

/// Print a shell's completion script
#[derive(Debug, Args)]
#[command(after_help = "\
Examples:
  bikebot completions bash > ~/.local/share/bash-completion/completions/bikebot
  bikebot completions zsh > ~/.zfunc/_bikebot
  bikebot completions fish > ~/.config/fish/completions/bikebot.fish")]
pub struct CompletionsArgs {
    /// Which shell
    #[arg(value_name = "SHELL")]
    pub shell: Shell,
}

/// Prints it.
pub fn run(args: &CompletionsArgs, terminal: &Terminal) -> Ending {
    let mut script = Vec::new();
    clap_complete::generate(args.shell, &mut Cli::command(), "bikebot", &mut script);
    terminal.print(&String::from_utf8_lossy(&script))?;
    Ok(Exit::Done)
}
