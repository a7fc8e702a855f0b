//! What the compiler cannot enforce about the shape of the code.

use checks::{product_code, repository, rust_files};
use std::collections::BTreeSet;
use std::path::{Path, PathBuf};
use std::process::Command;

/// Folders of the crates that are functions of their arguments.
const CORES: [&str; 8] = [
    "proto/core",
    "netsim/physics",
    "netsim",
    "robotsim",
    "orchestrator/numbers",
    "orchestrator/metrics",
    "orchestrator/study",
    "orchestrator/diagnose",
];

/// Folders of further crates that compute: they read files, but take elementary functions from libm as cores do.
const COMPUTE: [&str; 3] = ["orchestrator/convert", "orchestrator/measure", "orchestrator/network"];

fn crates() -> [PathBuf; 5] {
    ["proto", "netsim", "robotsim", "orchestrator", "tests"].map(|name| repository().join(name))
}

#[test]
fn no_file_exceeds_600_lines() {
    for file in crates().iter().flat_map(|folder| rust_files(folder)) {
        let n_lines = std::fs::read_to_string(&file).unwrap().lines().count();
        assert!(
            n_lines <= 600,
            "{} has {n_lines} lines: does it still say one thing?",
            file.display()
        );
    }
}

#[test]
fn clippy_holds_what_computes_to_the_rules_of_cores() {
    let rules =
        |name: &str| std::fs::read_to_string(repository().join(name).join("clippy.toml")).unwrap();
    for name in CORES.iter().chain(&COMPUTE) {
        assert_eq!(rules(name), rules("proto/core"), "{name}/clippy.toml");
    }
}

/// Files of the kernel and the sources that a build script reads are not input.
const NOT_INPUT: [&str; 2] = ["\"/proc/", "fs::read(source)"];

#[test]
fn the_orchestrator_reads_files_up_to_a_bound() {
    let mut n_files = 0;
    for file in rust_files(&repository().join("orchestrator")) {
        // The repository itself may stand in a folder called tests.
        let path = file.strip_prefix(repository()).unwrap();
        if path.components().any(|part| {
            ["tests", "tests.rs", "benches", "build.rs"]
                .contains(&&*part.as_os_str().to_string_lossy())
        }) {
            continue;
        }
        n_files += 1;
        let code = product_code(&std::fs::read_to_string(&file).unwrap());
        for line in code.lines().filter(|line| {
            ["fs::read(", "fs::read_to_string(", ".read_to_end(&"]
                .iter()
                .any(|call| line.contains(call))
        }) {
            assert!(
                NOT_INPUT.iter().any(|allowed| line.contains(allowed)),
                "{}: reads without a bound of proto::bounds: {}",
                file.display(),
                line.trim()
            );
        }
    }
    assert!(100 < n_files, "{n_files}");
}

/// Files that open files or results past `input`, and why these need no check against `provenance.json`.
const UNCHECKED: [(&str, &str); 30] = [
    ("orchestrator/convert/src/formats/parquet.rs", "a log, whose file the caller has opened"),
    ("orchestrator/convert/src/mapping.rs", "mapping files"),
    ("orchestrator/demo/src/lib.rs", "the folder is a file"),
    ("orchestrator/drive/src/peer/channel.rs", "certificates"),
    ("orchestrator/drive/src/peer/process.rs", "random bytes"),
    ("orchestrator/experiment/src/file_kind.rs", "whether a file is TOML or a table"),
    ("orchestrator/experiment/src/lib.rs", "experiment files"),
    ("orchestrator/experiment/src/sides.rs", "files that an experiment names"),
    ("orchestrator/index/src/read.rs", "when a run ended, which provenance.json alone says"),
    ("orchestrator/index/src/unfinished.rs", "runs and sweeps that are being recorded"),
    ("orchestrator/measure/src/formats.rs", "measurements, once they are known to be of no result"),
    ("orchestrator/record/src/bounded.rs", "journals, locks, checkpoints, formed networks"),
    ("orchestrator/record/src/checkpoint.rs", "/dev/null"),
    ("orchestrator/record/src/directory.rs", "folders"),
    ("orchestrator/record/src/ending.rs", "how an unfinished run ended"),
    ("orchestrator/record/src/formed.rs", "formed networks"),
    ("orchestrator/record/src/lock.rs", "locks"),
    ("orchestrator/record/src/pcap.rs", "a capture that is being written"),
    ("orchestrator/record/src/read.rs", "the recording of an unfinished run"),
    ("orchestrator/record/src/run_summary.rs", "the summary that a new result replaces"),
    ("orchestrator/record/src/verify.rs", "what it checks itself"),
    ("orchestrator/report/src/player.rs", "the run that is being written"),
    (
        "orchestrator/run/src/recover.rs",
        "whether a folder is a result, and two recordings that differ",
    ),
    ("orchestrator/src/cli/replay.rs", "the run that this program has just finished"),
    ("orchestrator/sweep/src/engine/progress.rs", "the journal of a shard"),
    ("orchestrator/sweep/src/journal.rs", "the journal of a sweep"),
    ("orchestrator/sweep/src/engine/submission.rs", "the journal of a submission"),
    ("orchestrator/sweep/src/engine/follow.rs", "logs of a batch system"),
    ("orchestrator/sweep/src/verify.rs", "whether a folder is a result of a sweep"),
    ("orchestrator/measure/src/formats/parquet.rs", "what formats.rs has opened"),
];

/// What opens a file past the checks of `input::result`: nothing else gives bytes of a result.
fn unchecked_reads(code: &str) -> Vec<&str> {
    let calls = [
        "File::open(",
        "fs::read(",
        "fs::read_to_string(",
        "read_file(",
        "read_text_file(",
        "SerializedFileReader::new(",
        "MessageStream::new(",
        "CheckedFile::unchecked(",
        "ResultFolder::unchecked(",
    ];
    let is_read = |line: &&str| calls.iter().any(|call| line.contains(call));
    let is_input = |line: &&str| !NOT_INPUT.iter().any(|allowed| line.contains(allowed));
    code.lines().filter(is_read).filter(is_input).collect()
}

#[test]
fn every_reader_of_a_result_has_its_files_checked() {
    for dummy in [
        "let a = 1;\nlet b = SerializedFileReader::new(file)?;",
        "let text = read_file(&BOUND, &run.join(\"summary.json\"))?;",
        "let table = std::fs::File::open(run.join(\"steps.parquet\"))?;",
        "let file = CheckedFile::unchecked(&run.join(\"run.mcap\"))?;",
    ] {
        assert_eq!(unchecked_reads(dummy).len(), 1, "{dummy}");
    }
    for file in rust_files(&repository().join("orchestrator")) {
        let path = file.strip_prefix(repository()).unwrap();
        let parts: Vec<_> = path.iter().map(|part| part.to_string_lossy()).collect();
        let is_test =
            |part: &str| ["tests", "tests.rs", "benches", "examples", "build.rs"].contains(&part);
        if parts.iter().any(|part| is_test(part))
            || ["input", "system"].contains(&&*parts[1])
            || UNCHECKED.iter().any(|(allowed, _)| path == Path::new(allowed))
        {
            continue;
        }
        let code = product_code(&std::fs::read_to_string(&file).unwrap());
        let reads = unchecked_reads(&code);
        assert!(reads.is_empty(), "{}: open it through input::result: {reads:?}", path.display());
    }
}

/// Calls that change files or folders, or read the wall clock, past `orchestrator/system`, where faults are injected.
fn bypasses(code: &str) -> Vec<&str> {
    const CALLS: [&str; 13] = [
        "fs::write(",
        "fs::rename(",
        "fs::remove_",
        "fs::create_dir",
        "fs::copy(",
        "fs::hard_link(",
        "fs::set_permissions(",
        "fs::File::create",
        "OpenOptions",
        "DirBuilder",
        "Writer::from_path(",
        "tempfile::",
        "SystemTime::now",
    ];
    let imports = |line: &&str| line.starts_with("use std::fs::") && line.contains("File");
    let is_of_std = code.lines().any(|line| imports(&line));
    let opens = ["File::create", "File::options("];
    code.lines()
        .filter(|line| {
            let line = line.replace("system::File", "").replace("WholeFile", "");
            CALLS.iter().any(|call| line.contains(call))
                || is_of_std && opens.iter().any(|call| line.contains(call))
        })
        .map(str::trim)
        .collect()
}

#[test]
fn the_orchestrator_changes_files_in_one_crate() {
    // Sockets and tokens of simulators, and folders of temporary files, which no result depends on.
    const EXEMPT: [&str; 2] =
        ["orchestrator/drive/src/peer/process.rs", "orchestrator/drive/src/private_folder.rs"];
    for file in rust_files(&repository().join("orchestrator")) {
        let path = file.strip_prefix(repository()).unwrap();
        let parts: Vec<_> = path.iter().map(|part| part.to_string_lossy()).collect();
        let is_test =
            |part: &str| ["tests", "tests.rs", "benches", "examples", "build.rs"].contains(&part);
        if parts.iter().any(|part| is_test(part))
            || parts[1] == "system"
            || EXEMPT.iter().any(|exempt| path == Path::new(exempt))
        {
            continue;
        }
        let code = product_code(&std::fs::read_to_string(&file).unwrap());
        let found = bypasses(&code);
        assert!(found.is_empty(), "{}: call orchestrator/system: {found:?}", path.display());
    }
    for dummy in [
        "std::fs::write(path, text)?;",
        "use std::fs::{self, File};\nlet file = File::create_new(&path)?;",
        "let file = std::fs::File::create(path)?;",
        "let folder = tempfile::tempdir()?;",
        "let file = OpenOptions::new().append(true).open(path)?;",
        "let now = SystemTime::now();",
    ] {
        assert_eq!(bypasses(dummy).len(), 1, "{dummy}");
    }
    let good = "use system::File;\nlet file = File::create(&path)?;\nsystem::rename(a, b)?;";
    assert_eq!(bypasses(good), Vec::<&str>::new());
}

#[test]
fn the_two_simulators_do_not_know_each_other() {
    let manifest =
        |name: &str| std::fs::read_to_string(repository().join(name).join("Cargo.toml")).unwrap();
    assert!(!manifest("netsim").contains("robotsim.workspace"));
    assert!(!manifest("robotsim").contains("netsim.workspace"));
    for part in ["proto/core", "proto/messages", "proto/host"] {
        for other in ["netsim", "robotsim", "orchestrator"] {
            assert!(!manifest(part).contains(&format!("{other}.workspace")));
        }
    }
}

/// What serves, parses a command line or knows the wire: no core may link it.
const SHELL: &[&str] = &["clap", "hyper", "mcap", "prost", "tokio", "tonic"];

/// Packages, and the families of packages (`tonic`: also `tonic-types`) that they may not link, however indirectly.
const WALLS: &[(&str, &[&str])] = &[
    ("proto", SHELL),
    ("physics", SHELL),
    ("physics", &["netsim", "robotsim"]),
    ("netsim", SHELL),
    ("robotsim", SHELL),
    ("proto-messages", &["clap", "hyper", "mcap", "tokio", "tonic"]),
    ("proto-host", &["mcap"]),
    ("numbers", SHELL),
    ("input", SHELL),
    ("input", &["experiment", "measure", "physics", "record"]),
    ("measure", SHELL),
    ("convert", SHELL),
    ("convert", &["diagnose", "experiment", "metrics", "record", "report", "study"]),
    ("study", SHELL),
    ("study", &["diagnose", "netsim", "experiment", "metrics", "record", "report"]),
    ("diagnose", SHELL),
    ("diagnose", &["netsim", "experiment", "metrics", "record", "report"]),
    ("metrics", SHELL),
    ("experiment", SHELL),
    ("experiment", &["metrics", "record", "report"]),
    ("record", &["clap", "hyper", "tokio", "tonic"]),
    ("drive", &["diagnose", "mcap", "metrics", "parquet", "record", "report", "study"]),
    ("network", &["mcap", "record", "report"]),
    ("report", &["orchestrator", "run"]),
    ("run", &["clap_complete", "clap_mangen", "orchestrator"]),
    ("check", SHELL),
    ("check", &["experiment", "metrics", "record", "report"]),
    ("export", &["hyper", "report", "tokio", "tonic"]),
    ("view", &["gif", "tiny-skia", "ttf-parser"]),
];

#[test]
fn what_a_package_links_stays_behind_its_wall() {
    for (package, forbidden) in WALLS {
        let linked = linked_by(package);
        assert!(linked.iter().any(|name| name == package), "{package}: {linked:?}");
        for family in *forbidden {
            let found = linked.iter().find(|name| {
                name.strip_prefix(family)
                    .is_some_and(|rest| rest.is_empty() || rest.starts_with('-'))
            });
            assert!(found.is_none(), "{package} links {}", found.unwrap());
        }
    }
}

/// Packages that the command line alone calls.
const COMMANDS: [&str; 7] = ["bench", "check", "conformance", "demo", "effects", "export", "sweep"];

#[test]
fn commands_do_without_each_other_and_without_the_command_line() {
    for package in COMMANDS {
        let linked = linked_by(package);
        assert!(linked.iter().any(|name| name == package), "{package}: {linked:?}");
        let others = COMMANDS.into_iter().filter(|&other| other != package);
        for other in others.chain(["clap_complete", "clap_mangen", "orchestrator"]) {
            assert!(!linked.iter().any(|name| name == other), "{package} links {other}");
        }
    }
}

/// Packages that a sweep links only to print, draw and explain: they decide no figure of a trial.
const WITHOUT_FIGURES: [&str; 7] =
    ["diagnose", "measure", "network", "report", "study", "terminal", "view"];

#[test]
fn the_fingerprint_of_a_sweep_is_of_all_code_that_decides_its_results() {
    let root = repository();
    let script = std::fs::read_to_string(root.join("orchestrator/sweep/build.rs")).unwrap();
    let (_, list) = script.split_once("const CRATES").unwrap();
    let (list, _) = list.split_once("];").unwrap();
    let covered: BTreeSet<String> = list
        .split('"')
        .skip(1)
        .step_by(2)
        .map(|folder| {
            let manifest = std::fs::read_to_string(root.join(folder).join("Cargo.toml")).unwrap();
            let manifest: toml::Table = toml::from_str(&manifest).unwrap();
            manifest["package"]["name"].as_str().unwrap().to_owned()
        })
        .collect();
    let own = packages();
    let linked: BTreeSet<String> =
        linked_by("sweep").into_iter().filter(|name| own.contains(name)).collect();
    let wanted: BTreeSet<String> =
        linked.into_iter().filter(|name| !WITHOUT_FIGURES.contains(&name.as_str())).collect();
    assert_eq!(covered, wanted);
}

/// Names of the packages that `package` links, itself included: tests and build scripts may use others.
fn linked_by(package: &str) -> Vec<String> {
    tree(&["--edges", "normal", "--format", "{p}", "--package", package])
        .iter()
        .filter_map(|line| line.split(' ').next())
        .map(str::to_owned)
        .collect()
}

/// Lines of `cargo tree`, each once.
fn tree(args: &[&str]) -> Vec<String> {
    let tree = Command::new(env!("CARGO"))
        .args(["tree", "--offline", "--locked", "--prefix", "none"])
        .args(args)
        .current_dir(repository())
        .output()
        .unwrap();
    assert!(tree.status.success(), "{}", String::from_utf8_lossy(&tree.stderr));
    let text = String::from_utf8(tree.stdout).unwrap();
    let lines: BTreeSet<&str> =
        text.lines().map(|line| line.strip_suffix(" (*)").unwrap_or(line)).collect();
    lines.into_iter().map(str::to_owned).collect()
}

/// Cargo builds a library once for each set of its features, and everything that depends on it as often. Where development
/// dependencies switch on more features than the program needs, `cargo test` builds nearly all of it a second time: such features
/// belong into orchestrator/Cargo.toml, too.
#[test]
fn the_program_and_the_tests_share_one_build_of_every_library() {
    let format = ["--format", "{p} {f}"];
    let of_tests = tree(&[&["--workspace", "--edges", "normal,dev"], &format[..]].concat());
    let program = ["--package", "orchestrator", "--edges", "normal"];
    for library in tree(&[&program[..], &format[..]].concat()) {
        assert!(of_tests.contains(&library), "tests build {library} with other features");
    }
}

#[test]
fn campaigns_share_nothing_with_what_they_judge() {
    let mut files = rust_files(&repository().join("tests/campaign"));
    assert!(5 <= files.len());
    files.push(repository().join("tests/campaign.rs"));
    for file in files {
        let text = std::fs::read_to_string(&file).unwrap();
        for name in packages() {
            let path = format!("{}::", name.replace('-', "_"));
            let uses = |line: &str| {
                line.split(|c: char| !(c.is_alphanumeric() || "_:".contains(c)))
                    .any(|word| word.starts_with(&path))
            };
            assert!(name == "tests" || !text.lines().any(uses), "{} uses {path}", file.display());
        }
    }
}

/// Names of the packages of the workspace.
fn packages() -> Vec<String> {
    let manifest = std::fs::read_to_string(repository().join("Cargo.toml")).unwrap();
    let manifest: toml::Table = toml::from_str(&manifest).unwrap();
    let members = manifest["workspace"]["members"].as_array().unwrap().clone();
    let name = |member: toml::Value| {
        let path = repository().join(member.as_str().unwrap()).join("Cargo.toml");
        let manifest: toml::Table =
            toml::from_str(&std::fs::read_to_string(path).unwrap()).unwrap();
        manifest["package"]["name"].as_str().unwrap().to_owned()
    };
    members.into_iter().map(name).collect()
}

#[test]
fn architecture_md_names_every_crate_of_the_workspace() {
    let text = std::fs::read_to_string(repository().join("ARCHITECTURE.md")).unwrap();
    let manifest = std::fs::read_to_string(repository().join("Cargo.toml")).unwrap();
    let manifest: toml::Table = toml::from_str(&manifest).unwrap();
    let members = manifest["workspace"]["members"].as_array().unwrap();
    assert!(18 <= members.len());
    for member in members.iter().filter_map(toml::Value::as_str) {
        assert!(text.contains(&format!("`{member}/`")), "ARCHITECTURE.md does not name {member}/");
    }
}

#[test]
fn every_path_that_architecture_md_names_exists() {
    let text = std::fs::read_to_string(repository().join("ARCHITECTURE.md")).unwrap();
    let paths: Vec<&str> = text
        .split('`')
        .skip(1)
        .step_by(2)
        .filter(|word| word.contains('/') && !word.contains([' ', '*', '<', ':', '{']))
        .collect();
    assert!(10 <= paths.len(), "{paths:?}");
    for path in paths {
        assert!(repository().join(path).exists(), "ARCHITECTURE.md names {path}");
    }
}

#[test]
fn every_link_between_the_pages_leads_somewhere() {
    let mut pages = vec![repository().join("README.md"), repository().join("CONTRIBUTING.md")];
    for entry in std::fs::read_dir(repository().join("docs")).unwrap() {
        pages.push(entry.unwrap().path());
    }
    let mut n_links = 0;
    for page in
        pages.iter().filter(|page| page.extension().is_some_and(|extension| extension == "md"))
    {
        let text = std::fs::read_to_string(page).unwrap();
        for link in text.split("](").skip(1).filter_map(|rest| rest.split(')').next()) {
            let path = link.split('#').next().unwrap();
            if path.is_empty() || path.contains("://") {
                continue;
            }
            n_links += 1;
            assert!(
                page.parent().unwrap().join(path).exists(),
                "{} links to {link}",
                page.display()
            );
        }
    }
    assert!(20 <= n_links, "{n_links}");
}
