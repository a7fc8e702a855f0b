//! What the pages show is what the programs print.

use tests::documented::{LARGE, LONG, commands, deviations_of_page, pages};

#[test]
fn numbers_on_the_pages_are_those_that_the_documented_commands_print() {
    let programs = tests::executable("murmuration").parent().unwrap().to_owned();
    let mut wrong = Vec::new();
    let mut n_run = 0;
    let is_short = |page: &&String| !LONG.iter().chain(&LARGE).any(|other| other == page);
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
fn pages_whose_commands_take_long_have_some() {
    for page in LONG.into_iter().chain(LARGE) {
        let text = std::fs::read_to_string(tests::repository().join(page)).unwrap();
        assert!(
            !commands(&text).is_empty(),
            "{page} has nothing to run: it need not be in the list"
        );
    }
}
