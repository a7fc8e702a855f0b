//! What a new user meets first: the help, starter experiments, completions, manual pages, the documentation site.

use orchestrator::cli;
use std::path::{Path, PathBuf};
use std::process::{Command, Output, Stdio};

const KINDS: [&str; 6] =
    ["flocking", "formation", "sensors", "exploration", "measured-links", "measured-robots"];

/// The program under another name, in a folder.
fn linked(folder: &Path, name: &str) -> PathBuf {
    let path = folder.join(name);
    std::os::unix::fs::symlink(tests::executable("murmuration"), &path).unwrap();
    path
}

fn asked(program: &Path, args: &[&str], folder: &Path) -> Output {
    Command::new(program)
        .args(args)
        .current_dir(folder)
        .env_remove("MURMURATION_DOCS")
        .stdin(Stdio::null())
        .output()
        .unwrap()
}

fn text(output: &Output) -> String {
    assert!(output.status.success(), "{}", tests::said(output));
    String::from_utf8(output.stdout.clone()).unwrap()
}

/// Names of the commands that users see.
fn names() -> Vec<String> {
    let command = cli::command();
    let visible = command.get_subcommands().filter(|command| !command.is_hide_set());
    visible.map(|command| command.get_name().to_owned()).collect()
}

/// Asserts that a command line is valid; the words must not need a shell.
fn assert_parses(line: &str) {
    let words = line.split_whitespace();
    let parsed = cli::command().try_get_matches_from(words);
    assert!(parsed.is_ok(), "{line}: {}", parsed.unwrap_err());
}

#[test]
fn every_starter_works_as_it_is() {
    let dir = tests::folder();
    for kind in KINDS {
        let name = format!("my-{kind}");
        let made = tests::orchestrator(&["new", &name, "--kind", kind], dir.path());
        let made = text(&made);
        assert!(made.contains(&name), "{made}");
        let folder = dir.path().join(&name);
        let next: Vec<&str> =
            made.lines().filter_map(|line| line.strip_prefix("  murmuration ")).collect();
        assert!(2 <= next.len(), "{made}");
        for line in next.iter().filter(|line| !line.contains("--live")) {
            let words: Vec<&str> = line.split_whitespace().collect();
            let found = text(&tests::orchestrator(&words, &folder));
            match (kind, words[0]) {
                (_, "run") => assert!(folder.join("runs").join(&name).is_dir(), "{found}"),
                ("measured-links", "diagnose") => {
                    assert!(found.contains("missing: wall-attenuation\n"), "{found}");
                }
                ("measured-robots", "diagnose") => {
                    assert!(found.contains("missing: wind\n"), "{found}");
                }
                _ => {}
            }
        }
    }
}

#[test]
fn what_starters_suggest_is_valid() {
    let dir = tests::folder();
    for kind in KINDS {
        assert!(
            tests::orchestrator(&["new", kind, "--kind", kind], dir.path()).status.success(),
            "{kind}"
        );
        let folder = dir.path().join(kind);
        let file = if kind.starts_with("measured") { "model.toml" } else { "experiment.toml" };
        let starter = std::fs::read_to_string(folder.join(file)).unwrap();
        assert!(!starter.contains('@'), "{starter}");
        let (_, next) = starter.split_once("# What to try next:\n").unwrap();
        let mut n_commands = 0;
        let mut explanation = "";
        for line in next.lines() {
            let Some(command) = line.strip_prefix("#   ") else {
                explanation = line;
                continue;
            };
            // The explanation is the line above.
            assert!(explanation.len() > 3 && explanation.ends_with(':'), "{line}");
            explanation = "";
            assert_parses(command);
            n_commands += 1;
            // The changes that it suggests make a valid experiment.
            let words: Vec<&str> = command.split_whitespace().skip(1).collect();
            if let ["run", rest @ ..] = &words[..] {
                let rest = rest.iter().copied().filter(|&word| word != "--live");
                let check: Vec<&str> = std::iter::once("check").chain(rest).collect();
                let checked = tests::orchestrator(&check, &folder);
                assert!(checked.status.success(), "{line}: {}", tests::said(&checked));
            }
        }
        assert_eq!(n_commands, 5, "{kind}");
    }
}

#[test]
fn a_starter_overwrites_nothing_and_its_errors_name_the_fix() {
    let dir = tests::folder();
    std::fs::write(dir.path().join("taken"), "mine").unwrap();
    let refused = |args: &[&str], expected: &[&str]| {
        let output = tests::orchestrator(&[&["new"], args].concat(), dir.path());
        let said = tests::said(&output);
        assert_eq!(output.status.code(), Some(2), "{said}");
        for text in expected {
            assert!(said.contains(text), "{text}: {said}");
        }
    };
    refused(&["taken"], &["taken: exists already; give another name"]);
    refused(&["my swarm"], &["letters, digits", "use my-swarm"]);
    refused(&[".."], &["use experiment"]);
    refused(&["nowhere/x"], &["the folder nowhere does not exist"]);
    refused(&["x", "--kind", "floking"], &["'flocking'", "measured-robots"]);
    let entries: Vec<_> = std::fs::read_dir(dir.path()).unwrap().collect();
    assert_eq!(entries.len(), 1, "{entries:?}");
    assert_eq!(std::fs::read_to_string(dir.path().join("taken")).unwrap(), "mine");
}

#[test]
fn starters_are_the_same_each_time() {
    let dir = tests::folder();
    for folder in ["a", "b"] {
        let folder = dir.path().join(folder);
        let made = tests::orchestrator(&["new", "x", "--kind", "measured-links"], &folder);
        assert!(made.status.success(), "{}", tests::said(&made));
    }
    for file in ["links.csv", "model.toml", "truth.toml"] {
        let [a, b] = ["a", "b"]
            .map(|folder| std::fs::read(dir.path().join(folder).join("x").join(file)).unwrap());
        assert!(a == b, "{file}");
    }
}

#[test]
fn the_help_of_every_command_has_a_valid_example_and_related_commands() {
    let dir = tests::folder();
    let names = names();
    for name in &names {
        let help = text(&tests::orchestrator(&[name, "--help"], dir.path()));
        let (_, after) = help.split_once("Example:\n  ").expect(name);
        let (example, related) = after.split_once('\n').unwrap_or((after, ""));
        assert!(example.starts_with(&format!("murmuration {name}")), "{example}");
        assert_parses(example);
        let related = related.trim().strip_prefix("Related commands: ").expect(name);
        for other in related.split(", ") {
            assert!(names.iter().any(|known| known == other) && other != name, "{name}: {other}");
        }
    }
}

#[test]
fn the_help_groups_all_commands() {
    let dir = tests::folder();
    let help = text(&tests::orchestrator(&["--help"], dir.path()));
    let headings = [
        "Start here:",
        "Run experiments:",
        "Compare with measurements:",
        "Look at results:",
        "Connect your own simulator:",
        "Maintain:",
        "Options:",
    ];
    let places = headings.map(|heading| help.find(heading).expect(heading));
    assert!(places.is_sorted(), "{help}");
    for name in names() {
        let lines = help.lines().filter(|line| line.starts_with(&format!("  {name} ")));
        assert_eq!(lines.count(), 1, "{name}: {help}");
    }
    assert!(help.lines().all(|line| line.chars().count() <= 100), "{help}");
    assert!(!help.contains('\u{1b}') && !help.contains('{'), "{help}");
}

#[test]
fn misspelt_commands_and_options_get_a_suggestion() {
    let dir = tests::folder();
    for (args, expected) in [
        (&["diagnos"][..], "`diagnose`"),
        (&["run", "x.toml", "--sed", "2"], "'--seed'"),
        (&["export", "r", "--format", "rosbag"], "'rosbag2'"),
    ] {
        let output = tests::orchestrator(args, dir.path());
        let said = tests::said(&output);
        assert_eq!(output.status.code(), Some(2), "{said}");
        assert!(said.contains("tip: ") && said.contains(expected), "{said}");
    }
}

#[test]
fn option_names_agree() {
    cli::command().debug_assert();
    for command in cli::command().get_subcommands().filter(|command| !command.is_hide_set()) {
        for option in command.get_arguments() {
            let expected = match option.get_long() {
                Some("out") => "DIR",
                Some("output") => "FILE",
                _ => continue,
            };
            let values = option.get_value_names().unwrap_or_default();
            assert_eq!(values, [expected], "{} {}", command.get_name(), option.get_id());
        }
    }
    // The names of earlier versions still work.
    for line in [
        "orchestrator convert m.toml --out t.csv",
        "orchestrator export r --format csv --output t",
        "orchestrator sweep e.toml --output t",
    ] {
        assert_parses(line);
    }
}

#[test]
fn the_program_calls_itself_by_the_name_that_was_typed() {
    let dir = tests::folder();
    for name in ["murmuration", "orchestrator"] {
        let program = linked(dir.path(), name);
        let said = |args: &[&str]| tests::said(&asked(&program, args, dir.path()));
        assert!(said(&["--help"]).contains(&format!("Usage: {name} ")));
        assert!(said(&["--version"]).contains(&format!("{name} 0.")));
        assert!(said(&["run", "--help"]).contains(&format!("Usage: {name} run ")));
        assert!(said(&["run"]).contains(&format!("Usage: {name} run ")));
        assert!(said(&["effects", "slp"]).contains(&format!("`{name} effects` lists all")));
        assert!(said(&["completions", "bash"]).contains(&format!("_{name}()")));
        let made = said(&["new", &format!("of-{name}")]);
        assert!(made.contains(&format!("  {name} run experiment.toml")), "{made}");
        // Simulators start as well as under the usual name.
        let experiment = format!("of-{name}/experiment.toml");
        let ran = asked(
            &program,
            &["run", &experiment, "--set", "experiment.duration_s=1.0"],
            dir.path(),
        );
        assert!(ran.status.success(), "{}", tests::said(&ran));
    }
    let other = linked(dir.path(), "something-else");
    assert!(text(&asked(&other, &["--version"], dir.path())).starts_with("murmuration "));
}

#[test]
fn completions_of_every_shell_contain_every_command() {
    let dir = tests::folder();
    for shell in ["bash", "elvish", "fish", "powershell", "zsh"] {
        let script = text(&tests::orchestrator(&["completions", shell], dir.path()));
        for name in names() {
            assert!(script.contains(&name), "{shell}: {name}");
        }
        assert!(script.contains("given-rssi"), "{shell}");
    }
}

#[test]
fn every_command_has_a_manual_page() {
    let dir = tests::folder();
    let said = text(&tests::orchestrator(&["man", "share/man1"], dir.path()));
    let pages = dir.path().join("share/man1");
    let names = names();
    assert!(said.contains(&format!("{} manual pages", names.len() + 1)), "{said}");
    assert_eq!(std::fs::read_dir(&pages).unwrap().count(), names.len() + 1);
    let main = std::fs::read_to_string(pages.join("murmuration.1")).unwrap();
    assert!(main.contains(".TH murmuration 1"), "{main}");
    for name in names {
        let page = std::fs::read_to_string(pages.join(format!("murmuration-{name}.1"))).unwrap();
        assert!(page.contains("Example:"), "{name}: {page}");
    }
}

#[test]
fn the_documentation_is_found_or_its_place_is_named() {
    let dir = tests::folder();
    // A program outside of any checkout.
    let prefix = dir.path().join("usr");
    std::fs::create_dir_all(prefix.join("bin")).unwrap();
    let program = prefix.join("bin/murmuration");
    // A process of its own copies it: a descriptor of this one that another test's child inherits would keep the file busy.
    let copied = Command::new("cp").arg(tests::executable("murmuration")).arg(&program).status();
    assert!(copied.unwrap().success());
    let ask = |folder: &Path, named: Option<&Path>, args: &[&str]| {
        let mut command = Command::new(&program);
        command.args(args).current_dir(folder).env("BROWSER", "true").stdin(Stdio::null());
        match named {
            Some(named) => command.env("MURMURATION_DOCS", named),
            None => command.env_remove("MURMURATION_DOCS"),
        };
        command.output().unwrap()
    };
    let print = ["docs", "--print"];
    let missing = ask(dir.path(), None, &print);
    assert_eq!(missing.status.code(), Some(1), "{}", tests::said(&missing));
    assert!(tests::said(&missing).contains("python3 docs/build.py"), "{}", tests::said(&missing));
    let site = |folder: &Path| {
        std::fs::create_dir_all(folder).unwrap();
        let page = folder.join("index.html");
        std::fs::write(&page, "<p>docs</p>").unwrap();
        page
    };
    // In a checkout that the user is in.
    let checkout = dir.path().join("checkout");
    std::fs::create_dir_all(checkout.join("docs")).unwrap();
    std::fs::write(checkout.join("docs/README.md"), "").unwrap();
    let page = site(&checkout.join("target/book"));
    let found = text(&ask(&checkout.join("docs"), None, &print));
    assert_eq!(Path::new(found.trim()).canonicalize().unwrap(), page.canonicalize().unwrap());
    // Installed.
    let page = site(&prefix.join("share/doc/murmuration/book"));
    let found = text(&ask(dir.path(), None, &print));
    assert_eq!(Path::new(found.trim()).canonicalize().unwrap(), page.canonicalize().unwrap());
    assert!(text(&ask(dir.path(), None, &["docs"])).starts_with("opened "));
    // Named.
    let page = site(&dir.path().join("elsewhere"));
    for named in [page.parent().unwrap(), &page] {
        assert_eq!(Path::new(text(&ask(dir.path(), Some(named), &print)).trim()), page);
    }
    let wrong = ask(dir.path(), Some(&dir.path().join("nowhere")), &print);
    assert_eq!(wrong.status.code(), Some(2), "{}", tests::said(&wrong));
    assert!(tests::said(&wrong).contains("MURMURATION_DOCS"), "{}", tests::said(&wrong));
}
