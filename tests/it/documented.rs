//! What the pages show is what the programs print.

use flate2::read::GzDecoder;
use std::io::Read as _;
use tests::campaign::blind::Cell;
use tests::documented::{LARGE, LONG, MEASURED, commands, deviations_of_page, pages};

#[test]
fn numbers_on_the_pages_are_those_that_the_documented_commands_print() {
    let programs = tests::executable("murmuration").parent().unwrap().to_owned();
    let mut wrong = Vec::new();
    let mut n_run = 0;
    let elsewhere = [&LONG[..], &LARGE, &MEASURED].concat();
    let is_short = |page: &&String| !elsewhere.contains(&page.as_str());
    for page in pages().iter().filter(is_short) {
        let text = std::fs::read_to_string(tests::repository().join(page)).unwrap();
        if commands(&text).is_empty() {
            continue;
        }
        n_run += 1;
        let folder = tests::folder();
        wrong.extend(deviations_of_page(page, folder.path(), &programs).unwrap());
    }
    assert!(wrong.is_empty(), "{}", wrong.join("\n"));
    assert!(3 <= n_run, "only {n_run} pages have commands to run");
}

#[test]
fn pages_that_other_tests_run_have_commands() {
    for page in LONG.into_iter().chain(LARGE).chain(MEASURED) {
        let text = std::fs::read_to_string(tests::repository().join(page)).unwrap();
        assert!(
            !commands(&text).is_empty(),
            "{page} has nothing to run: it need not be in the list"
        );
    }
}

#[test]
fn the_campaign_of_missing_physics_is_what_its_generator_makes() {
    let cells = Cell::plan(1, false);
    let name = "link: clear wall-attenuation + clear temperature";
    let cell = cells.iter().find(|cell| cell.name().contains(name)).unwrap();
    let campaign = cell.campaign(5000);
    let folder = tests::repository();
    let file = std::fs::File::open(folder.join("configs/missing-physics.csv.gz")).unwrap();
    let mut csv = String::new();
    GzDecoder::new(file).read_to_string(&mut csv).unwrap();
    assert!(csv == campaign.csv, "configs/missing-physics.csv.gz is not the generator's");
    let page = std::fs::read_to_string(folder.join("docs/missing-physics.md")).unwrap();
    assert!(page.contains(&campaign.config_toml), "{}", campaign.config_toml);
}
