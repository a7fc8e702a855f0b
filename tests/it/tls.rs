//! Simulators behind TLS: encrypted, checked on both ends, and with the same recording as without.

use rcgen::{
    BasicConstraints, CertificateParams, CertifiedIssuer, ExtendedKeyUsagePurpose, IsCa, KeyPair,
};
use std::path::{Path, PathBuf};
use tests::Server;
use tests::campaign::{Campaign, Drive, Fleet};

/// An authority and what it signed, as files.
struct Certificates {
    folder: tempfile::TempDir,
}

impl Certificates {
    fn make() -> Self {
        let folder = tests::folder();
        let made = Self { folder };
        let mut params = CertificateParams::new(Vec::new()).unwrap();
        params.is_ca = IsCa::Ca(BasicConstraints::Unconstrained);
        let authority = CertifiedIssuer::self_signed(params, KeyPair::generate().unwrap()).unwrap();
        std::fs::write(made.path("ca.pem"), authority.pem()).unwrap();
        for (name, purpose) in [
            ("server", ExtendedKeyUsagePurpose::ServerAuth),
            ("client", ExtendedKeyUsagePurpose::ClientAuth),
        ] {
            let key = KeyPair::generate().unwrap();
            let mut params = CertificateParams::new(vec!["127.0.0.1".to_owned()]).unwrap();
            params.extended_key_usages = vec![purpose];
            let certificate = params.signed_by(&key, &authority).unwrap();
            std::fs::write(made.path(&format!("{name}.pem")), certificate.pem()).unwrap();
            let path = made.path(&format!("{name}-key.pem"));
            std::fs::write(&path, key.serialize_pem()).unwrap();
            permit(&path, 0o600);
        }
        made
    }

    fn path(&self, name: &str) -> PathBuf {
        self.folder.path().join(name)
    }

    fn text(&self, name: &str) -> String {
        self.path(name).to_str().unwrap().to_owned()
    }

    fn serve(&self, simulator: &str) -> Server {
        let (cert, key, ca) =
            (self.text("server.pem"), self.text("server-key.pem"), self.text("ca.pem"));
        let args = ["--tls-cert", &cert, "--tls-key", &key, "--tls-client-ca", &ca];
        Server::start(simulator, &args).unwrap()
    }
}

/// Sets who may read a file.
fn permit(path: &Path, mode: u32) {
    use std::os::unix::fs::PermissionsExt as _;
    std::fs::set_permissions(path, std::fs::Permissions::from_mode(mode)).unwrap();
}

fn config() -> PathBuf {
    tests::repository().join("configs/flocking.toml")
}

fn run(folder: &Path, args: &[&str]) -> std::process::Output {
    let config = config();
    let args =
        [&["run", config.to_str().unwrap(), "--set", "experiment.duration_s=1.0"], args].concat();
    tests::orchestrator(&args, folder)
}

#[test]
fn mutual_tls_gives_the_same_recording_and_strangers_are_refused() {
    let certificates = Certificates::make();
    let strangers = Certificates::make();
    let (netsim, robotsim) = (certificates.serve("netsim"), certificates.serve("robotsim"));
    assert!(netsim.url.starts_with("https://"), "{}", netsim.url);
    let folder = tests::folder();
    let plain = tests::run(
        &config(),
        &folder.path().join("plain"),
        &["--set", "experiment.duration_s=1.0"],
    );

    let urls = ["--netsim", netsim.url.as_str(), "--robotsim", robotsim.url.as_str()];
    let with = |certificates: &Certificates| {
        [
            ["--tls-ca".to_owned(), certificates.text("ca.pem")],
            ["--tls-cert".to_owned(), certificates.text("client.pem")],
            ["--tls-key".to_owned(), certificates.text("client-key.pem")],
        ]
        .concat()
    };
    let as_text = |args: &[String]| args.iter().map(String::as_str).collect::<Vec<_>>().join("\n");
    let go = |tls: &[String], home: &str| {
        let tls = as_text(tls);
        let tls: Vec<&str> = tls.lines().collect();
        run(&folder.path().join(home), &[&urls, &tls[..]].concat())
    };

    let output = go(&with(&certificates), "tls");
    assert!(output.status.success(), "{}", tests::said(&output));
    tests::recording::assert_same(&plain, &folder.path().join("tls/runs/flocking"));

    // No certificate of our own, somebody else's, and an authority that did not sign theirs.
    let own = with(&certificates);
    let foreign = with(&strangers);
    let mixed = [&own[..2], &foreign[2..]].concat();
    for (tls, what) in
        [(&own[..2], "anonymous"), (&mixed[..], "foreign"), (&foreign[..], "untrusted")]
    {
        let output = go(tls, what);
        assert_eq!(output.status.code(), Some(2), "{what}: {}", tests::said(&output));
        assert!(
            tests::said(&output).contains("cannot reach https://"),
            "{what}: {}",
            tests::said(&output)
        );
    }
}

/// By options, and by the section of the file.
#[test]
fn a_comparison_reaches_a_simulator_behind_tls_as_a_run_does() {
    let certificates = Certificates::make();
    let robotsim = certificates.serve("robotsim");
    let folder = tests::folder();
    let campaign = Campaign::robots(1, &Fleet::standard(Drive::Velocity), &[], 1000);
    std::fs::write(folder.path().join("robots.csv"), &campaign.csv).unwrap();
    std::fs::write(folder.path().join("plain.toml"), &campaign.config_toml).unwrap();
    let [ca, cert, key] =
        ["ca.pem", "client.pem", "client-key.pem"].map(|name| certificates.text(name));
    let section = format!("\n[experiment.tls]\nca = {ca:?}\ncert = {cert:?}\nkey = {key:?}\n");
    std::fs::write(folder.path().join("file.toml"), campaign.config_toml + &section).unwrap();
    let ask = |config: &str, more: &[&str]| {
        let args = ["compare", config, "--data", "robots.csv", "--robotsim", &robotsim.url];
        tests::orchestrator(&[&args[..], more].concat(), folder.path())
    };
    let options = ["--tls-ca", &ca, "--tls-cert", &cert, "--tls-key", &key];
    let by_options = ask("plain.toml", &options);
    assert!(by_options.status.success(), "{}", tests::said(&by_options));
    let by_file = ask("file.toml", &[]);
    assert_eq!(tests::said(&by_file), tests::said(&by_options));
    let anonymous = ask("plain.toml", &options[..2]);
    assert_eq!(anonymous.status.code(), Some(2), "{}", tests::said(&anonymous));
    assert!(tests::said(&anonymous).contains("robotsim: cannot reach https://"));
}

#[test]
fn a_key_that_others_can_read_is_refused_on_both_ends() {
    let certificates = Certificates::make();
    let netsim = certificates.serve("netsim");
    for name in ["server-key.pem", "client-key.pem"] {
        permit(&certificates.path(name), 0o640);
    }
    let (cert, key) = (certificates.text("server.pem"), certificates.text("server-key.pem"));
    let output = std::process::Command::new(tests::executable("netsim"))
        .args(["--tls-cert", &cert, "--tls-key", &key])
        .output()
        .unwrap();
    assert_eq!(output.status.code(), Some(2), "{}", tests::said(&output));
    let expected = format!(
        "error: --tls-key {key}: other users can read it (its mode is 640); run: chmod 600 {key}\n"
    );
    assert_eq!(String::from_utf8_lossy(&output.stderr), expected);

    let folder = tests::folder();
    let (ca, cert, key) = (
        certificates.text("ca.pem"),
        certificates.text("client.pem"),
        certificates.text("client-key.pem"),
    );
    let args = ["--tls-ca", &ca, "--tls-cert", &cert, "--tls-key", &key, "--netsim", &netsim.url];
    let output = run(folder.path(), &args);
    assert_eq!(output.status.code(), Some(2), "{}", tests::said(&output));
    assert!(
        tests::said(&output).contains("other users can read this private key (its mode is 640)"),
        "{}",
        tests::said(&output)
    );
}
