//! Pages of comparisons, as the command writes them.

use tests::campaign::{Campaign, Drive, Fleet, Hidden, Layout, Size};

#[test]
fn the_same_command_writes_the_same_page() {
    let folder = tests::folder();
    let robots = Campaign::robots(1, &Fleet::standard(Drive::Velocity), &[], 3000);
    let hidden = [(Hidden::Temperature, Size::Clear)];
    let links = Campaign::link(1, &Layout::standard(), &hidden, 2000);
    for (name, campaign, parts) in [
        ("links", links, ["Reception, as configured", "Error over temperature", "On the map"]),
        ("robots", robots, ["Error against horizon", "along the motion", "On the map"]),
    ] {
        let data = format!("{name}.csv");
        std::fs::write(folder.path().join(&data), &campaign.csv).unwrap();
        std::fs::write(folder.path().join("model.toml"), &campaign.config_toml).unwrap();
        let page = || {
            let args = ["compare", "model.toml", "--data", &data, "--report", "page.html"];
            let output = tests::orchestrator(&args, folder.path());
            assert!(output.status.success(), "{}", tests::said(&output));
            std::fs::read_to_string(folder.path().join("page.html")).unwrap()
        };
        let first = page();
        assert_eq!(first, page());
        for part in parts {
            assert!(first.contains(part), "{part} is not on the page of {name}");
        }
        assert!(
            !tests::without_scripts(&first).contains("NaN") && first.len() < 2_000_000,
            "{} bytes",
            first.len()
        );
        assert!(
            first.contains(&format!(
                "murmuration compare model.toml --data {data} --report page.html"
            ))
        );
    }
}

#[test]
fn a_page_that_cannot_be_written_is_refused_before_the_work() {
    let folder = tests::folder();
    let campaign = Campaign::link(1, &Layout::standard(), &[], 1000);
    std::fs::write(folder.path().join("links.csv"), &campaign.csv).unwrap();
    std::fs::write(folder.path().join("model.toml"), &campaign.config_toml).unwrap();
    let args = ["compare", "model.toml", "--data", "links.csv", "--report", "nowhere/page.html"];
    let output = tests::orchestrator(&args, folder.path());
    assert_eq!(output.status.code(), Some(2), "{}", tests::said(&output));
    assert!(
        tests::said(&output).contains("--report nowhere/page.html"),
        "{}",
        tests::said(&output)
    );
    assert!(!tests::said(&output).contains("rmse_db"), "it did the work first");
}
