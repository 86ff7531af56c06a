//! `carom completions`: completion of commands, options and their values in a shell.

use crate::error::CliError;
use clap::Args;
use clap_complete::{Shell, generate};
use std::io::{self, Write};

/// Print the script that completes commands, options and their values in a shell
///
/// Input: the name of the shell.
/// Output: the script. For the current session of bash: source <(carom completions bash). For all
/// sessions it is a file, by the usual configuration of the shells:
///   bash  ~/.local/share/bash-completion/completions/carom
///   zsh   _carom in a folder of $fpath
///   fish  ~/.config/fish/completions/carom.fish
#[derive(Args)]
#[command(verbatim_doc_comment)]
pub struct Completions {
    /// Shell
    #[arg(value_name = "SHELL")]
    shell: Shell,
}

impl Completions {
    /// Writes the script as it is, with the control characters that answers do not have.
    pub fn run(self, mut command: clap::Command) -> Result<(), CliError> {
        let mut script = Vec::new();
        generate(self.shell, &mut command, "carom", &mut script);
        Ok(io::stdout().write_all(&script)?)
    }
}
