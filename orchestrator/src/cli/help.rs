//! What the help shows besides the options: groups of commands, an example per command, related commands, groups of options.

use super::Cli;
use clap::{Command, CommandFactory as _};
use experiment::program_name;
use std::fmt::Write as _;

/// The help of a command: its name, an example (arguments after the name of the program), and related commands.
type CommandHelp = (&'static str, &'static str, &'static [&'static str]);

/// All commands by purpose, in the order of the help. Those that the program does not have are not shown.
const GROUPS: [(&str, &[CommandHelp]); 6] = [
    (
        "Start here",
        &[
            ("new", "new my-swarm --kind formation", &["run", "demo", "docs"]),
            ("demo", "demo", &["new", "diagnose"]),
            ("docs", "docs", &["effects", "schema"]),
        ],
    ),
    (
        "Run experiments",
        &[
            ("run", "run experiment.toml --seed 2", &["check", "replay", "sweep"]),
            ("sweep", "sweep experiment.toml --jobs 2", &["run", "compare-runs"]),
            ("check", "check experiment.toml", &["run", "schema", "compare"]),
            ("effects", "effects wall-attenuation", &["diagnose", "extend"]),
            ("metrics", "metrics pdr", &["sweep", "compare-runs"]),
        ],
    ),
    (
        "Compare with measurements",
        &[
            ("import", "import lab.csv", &["convert", "diagnose"]),
            ("convert", "convert mapping.toml --output links.csv", &["import", "check", "compare"]),
            (
                "compare",
                "compare model.toml --data links.csv --report comparison.html",
                &["check", "diagnose"],
            ),
            (
                "diagnose",
                "diagnose model.toml --data links.csv --report diagnosis.html",
                &["compare", "extend", "effects"],
            ),
            (
                "extend",
                "extend model.toml --data links.csv --effect wall-attenuation --output better.toml",
                &["diagnose", "compare", "effects"],
            ),
            (
                "simulate",
                "simulate model.toml --like links.csv --output simulated.csv",
                &["power", "diagnose"],
            ),
            (
                "power",
                "power model.toml --like links.csv --effect temperature",
                &["simulate", "diagnose"],
            ),
        ],
    ),
    (
        "Look at results",
        &[
            ("open", "open runs", &["replay", "compare-runs"]),
            ("replay", "replay runs/flocking", &["open", "render", "run"]),
            ("render", "render runs/flocking --video flock.gif", &["replay", "export"]),
            ("figure", "figure runs/flocking links --output links.pdf", &["render", "sweep"]),
            ("export", "export runs/flocking --format csv", &["render", "replay"]),
            (
                "compare-runs",
                "compare-runs runs/flocking runs/flocking-2",
                &["open", "run", "sweep"],
            ),
        ],
    ),
    (
        "Connect your own simulator",
        &[
            ("conformance", "conformance robotsim http://127.0.0.1:5000", &["run", "schema"]),
            ("netsim", "netsim --listen 127.0.0.1:50051", &["robotsim", "run"]),
            ("robotsim", "robotsim --listen 127.0.0.1:50061", &["netsim", "run"]),
            ("schema", "schema --of diagnose", &["check", "docs"]),
        ],
    ),
    (
        "Maintain",
        &[
            ("verify", "verify runs/flocking", &["reproduce", "recover"]),
            ("reproduce", "reproduce runs/flocking", &["verify", "compare-runs"]),
            ("recover", "recover runs/.flocking.partial-4711", &["run", "verify"]),
            ("bench", "bench --table swarm", &["run"]),
            ("completions", "completions bash", &["man"]),
            ("man", "man share/man/man1", &["completions", "docs"]),
        ],
    ),
];

/// Headings of options, and the options that stand under them in every command. Others stand under "Options".
const OPTION_GROUPS: [(&str, &[&str]); 9] = [
    ("Overrides", &["set", "seed"]),
    ("External simulators", &["netsim", "robotsim", "tls_ca", "tls_cert", "tls_key"]),
    ("Permissions", &["allow_command", "allow_file", "allow_url"]),
    (
        "Output",
        &[
            "out",
            "output",
            "replace",
            "json",
            "report",
            "residuals",
            "svg",
            "save_formed",
            "corrected_data",
        ],
    ),
    ("Live view", &["live", "live_control", "live_speed", "port"]),
    (
        "Several machines",
        &["shard", "merge", "engine", "shards", "emit", "emit_to", "wait_for_lock"],
    ),
    (
        "Rows and cross-validation",
        &["condition", "split", "fit_runs", "score_runs", "window", "losses", "given_rssi"],
    ),
    ("Packets and whole networks", &["positions", "seeds", "heard"]),
    ("Logging", &["log", "log_json"]),
];

/// Options that other commands have under the same name with another meaning.
const PACKET_COMMANDS: [&str; 3] = ["compare", "diagnose", "extend"];
const PACKET_OPTIONS: [&str; 3] = ["from", "until", "links"];

/// The command line, with its help, under the name that the program was called by.
#[must_use]
pub fn command() -> Command {
    let program = program_name();
    let plain = Cli::command();
    let has = |name: &str| plain.find_subcommand(name).is_some();
    let mut command = plain.clone().name(program).bin_name(program);
    command = command.mut_args(|option| match heading("", option.get_id().as_str()) {
        Some(heading) => option.help_heading(heading),
        None => option,
    });
    for &(name, example, related) in GROUPS.iter().flat_map(|(_, commands)| *commands) {
        if !has(name) {
            continue;
        }
        let related: Vec<&str> = related.iter().copied().filter(|name| has(name)).collect();
        let mut after = format!("Example:\n  {program} {example}");
        if !related.is_empty() {
            let _ = write!(after, "\n\nRelated commands: {}", related.join(", "));
        }
        command = command.mut_subcommand(name, |command| {
            let command = command.mut_args(|option| {
                if option.is_positional() {
                    return option;
                }
                match heading(name, option.get_id().as_str()) {
                    Some(heading) => option.help_heading(heading),
                    None => option,
                }
            });
            command.after_help(after)
        });
    }
    let template = template(&command);
    command.help_template(template)
}

/// Heading that an option stands under.
fn heading(command: &str, option: &str) -> Option<&'static str> {
    if PACKET_COMMANDS.contains(&command) && PACKET_OPTIONS.contains(&option) {
        return Some("Packets and whole networks");
    }
    let group = OPTION_GROUPS.iter().find(|(_, options)| options.contains(&option));
    group.map(|&(heading, _)| heading)
}

/// The help of the program itself: commands by purpose.
fn template(command: &Command) -> String {
    let program = program_name();
    let heading = |text: &str| format!("\x1b[1m\x1b[4m{text}:\x1b[0m");
    let mut text = "{about-with-newline}\n{usage-heading} {usage}\n".to_owned();
    for (title, commands) in GROUPS {
        let _ = writeln!(text, "\n{}", heading(title));
        for (name, ..) in commands {
            let Some(about) = command.find_subcommand(name).and_then(Command::get_about) else {
                continue;
            };
            let _ = writeln!(text, "  \x1b[1m{name:13}\x1b[0m {about}");
        }
    }
    let _ = write!(
        text,
        "\n{}\n{{options}}\n\nStart with `{program} new my-swarm`, then `{program} run my-swarm/experiment.toml`.\n\
         `{program} help COMMAND` explains a command and shows an example.",
        heading("Options")
    );
    text
}
