//! What a file asks for, and who may agree to it.

use super::*;
use bytes::Bytes;
use std::collections::BTreeSet;
use std::path::Path;

/// What the file with this text in the folder `base` asks for.
fn asked(text: &str, base: &str, overrides: &Overrides) -> Vec<Capability> {
    capabilities(&config::parse(text).unwrap(), Path::new(base), overrides)
}

/// The keys that ask for something, and the options that allow it.
fn options(text: &str, overrides: &Overrides) -> Vec<(String, String)> {
    let asked = asked(text, "/sandbox/own", overrides);
    asked.iter().map(|asked| (asked.key.clone(), asked.action.option())).collect()
}

fn one(key: &str, option: &str) -> Vec<(String, String)> {
    vec![(key.to_owned(), option.to_owned())]
}

const TRACE: &str = "[netsim.phy]\npropagation = \"trace\"\nfile = ";

#[test]
fn files_are_asked_for_if_they_lie_outside_of_the_folder() {
    let none = Overrides::default();
    assert_eq!(options(&format!("{TRACE}\"a.k7\""), &none), []);
    assert_eq!(options(&format!("{TRACE}\"deep/er/../a.k7\""), &none), []);
    assert_eq!(
        options(&format!("{TRACE}\"../a.k7\""), &none),
        one("netsim.phy.file", "--allow-file /sandbox/own/../a.k7")
    );
    let places = "[robotsim.scenario]\nkind = \"csv\"\nfile = \"/etc/hostname\"";
    assert_eq!(options(places, &none), one("robotsim.scenario.file", "--allow-file /etc/hostname"));
    let tls = "[experiment.tls]\nca = \"/ca.pem\"\n";
    assert_eq!(options(tls, &none), one("experiment.tls.ca", "--allow-file /ca.pem"));
    let formed = "[experiment]\nwarm_start = \"/formed\"\n";
    assert_eq!(options(formed, &none), one("experiment.warm_start", "--allow-file /formed"));
}

#[test]
fn a_link_that_leads_out_of_the_folder_is_outside() {
    let folder = std::env::temp_dir().join(format!("consent-{}", std::process::id()));
    let own = folder.join("own");
    std::fs::create_dir_all(&own).unwrap();
    std::fs::write(folder.join("secret"), "").unwrap();
    std::fs::write(own.join("inside"), "").unwrap();
    std::os::unix::fs::symlink(folder.join("secret"), own.join("link")).unwrap();
    let asked = |name: &str| {
        let text = format!("{TRACE}{name:?}");
        asked(&text, own.to_str().unwrap(), &Overrides::default()).len()
    };
    assert_eq!((asked("inside"), asked("link")), (0, 1));
    // So is what the user allows: the folder that holds the file, whatever leads there.
    let consent = Consent { files: vec![folder.clone()], ..Consent::default() };
    assert!(consent.covers(&Action::ReadFile { file: own.join("link") }));
    let consent = Consent { files: vec![own.clone()], ..Consent::default() };
    assert!(!consent.covers(&Action::ReadFile { file: own.join("link") }));
    std::fs::remove_dir_all(folder).unwrap();
}

#[test]
fn programs_elsewhere_are_called_only_if_they_are_allowed() {
    let none = Overrides::default();
    let url = |url: &str| format!("[netsim]\nurl = {url:?}\n");
    for local in ["http://127.0.0.1:1", "http://localhost:5", "http://[::1]:2"] {
        assert_eq!(options(&url(local), &none), [], "{local}");
    }
    for elsewhere in ["http://10.0.0.1:1", "https://a.example:5", "http://127.0.0.1.example:1"] {
        let option = format!("--allow-url {elsewhere}");
        assert_eq!(options(&url(elsewhere), &none), one("netsim.url", &option));
    }
    // The content of a file is sent to nobody, not even on this machine.
    let exfiltrates = "[netsim]\nurl = \"http://127.0.0.1:1\"\n[netsim.phy]\npropagation = \"trace\"\n\
        file = \"/etc/hostname\"\nother = \"/etc/hostname\"\n";
    let asked = asked(exfiltrates, "/sandbox/own", &none);
    let [call, file] = &asked[..] else { panic!("{asked:?}") };
    let sent = "send this experiment and the contents of /etc/hostname to http://127.0.0.1:1";
    assert_eq!(call.action.to_string(), sent);
    assert_eq!(file.action, Action::ReadFile { file: "/etc/hostname".into() });
    // What the command line names is consent.
    let given = Overrides { netsim_url: Some("http://b:1".to_owned()), ..Overrides::default() };
    assert_eq!(options(&url("http://a:1"), &given), []);
    let set = Overrides { set: vec!["netsim.url=http://a:1".to_owned()], ..Overrides::default() };
    assert_eq!(options(&url("http://a:1"), &set), []);
}

#[test]
fn programs_and_lines_for_a_cluster_need_one_option() {
    let text = "[robotsim]\ncommand = [\"./evil\", \"a b\"]\nworking_directory = \"x\"\n\
        [sweep.slurm]\ncommands = [\"touch a\"]\noptions = [\"--prolog=/x\"]\nmodules = [\"m\"]\n\
        partition = \"p\"\n[sweep.hyperqueue]\ncommands = [\"touch b\"]\n";
    let set =
        Overrides { set: vec!["robotsim.command=[\"./evil\"]".to_owned()], ..Overrides::default() };
    for overrides in [Overrides::default(), set] {
        let asked = asked(text, "/sandbox/own", &overrides);
        let keys: Vec<&str> = asked.iter().map(|asked| asked.key.as_str()).collect();
        let expected = [
            "robotsim.command",
            "sweep.slurm.options[0]",
            "sweep.slurm.modules[0]",
            "sweep.slurm.commands[0]",
            "sweep.hyperqueue.commands[0]",
        ];
        assert_eq!(keys, expected);
        assert!(asked.iter().all(|asked| asked.action.option() == "--allow-command"));
        let folder = Path::new("/sandbox/own/x").to_owned();
        let command = Action::Command { command: "./evil 'a b'".to_owned(), folder };
        assert_eq!(asked[0].action, command);
        let refused = |consent: Consent| consent.refusals(&asked).len();
        assert_eq!(refused(Consent::default()), 5);
        assert_eq!(refused(Consent { commands: true, ..Consent::default() }), 0);
        assert_eq!(refused(Consent { acts: Acts::Reads, ..Consent::default() }), 0);
    }
}

#[test]
fn what_was_recorded_is_not_read_again() {
    let text = format!("{TRACE}\"/elsewhere/a.k7\"");
    let mut overrides = Overrides::default();
    assert_eq!(options(&text, &overrides).len(), 1);
    overrides.files.insert(("netsim".to_owned(), "a.k7".to_owned()), Bytes::new());
    assert_eq!(options(&text, &overrides), []);
}

/// Forgetting a section here would let its keys do what they like.
#[test]
fn every_section_of_an_experiment_is_looked_at() {
    let schema = crate::schema();
    let sections: BTreeSet<&str> =
        schema["properties"].as_object().unwrap().keys().map(String::as_str).collect();
    let tables = sections.iter().filter(|section| **section != "timeline");
    let text: String = tables.map(|section| format!("[{section}]\n")).collect();
    let tree = config::parse(&format!("{text}[[timeline]]\n")).unwrap();
    let looked_at: BTreeSet<&str> =
        touches(&tree).into_iter().map(|(section, _)| section).collect();
    assert_eq!(looked_at, sections);
}
