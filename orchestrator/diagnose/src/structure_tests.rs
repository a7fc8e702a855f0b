//! Structure that no effect explains, in robots that are driven here.

#[path = "../../study/src/robots/tests/driven.rs"]
mod driven;

use crate::answer::{Measurements, answer};
use crate::ladder::Search;
use crate::scan;
use driven::{STEP_S, driven};
use measure::account::DataAccount;
use measure::robots;
use measure::table::DataTable;
use proto::effect::Level;
use robotsim::catalogue::Catalogue;
use study::choices::Choices;
use study::folds::scramble;
use study::open::Subject;
use study::robots::{RobotStudy, StatedSettings};
use study::{COMMON, Study as _, TermId};

/// Robots that a tide carries to the east, always, now more and now less: by as much as the noise in some seconds.
fn carried(n_steps: usize) -> DataTable {
    driven(n_steps, "tide_m", |step, command, at, _| {
        let tide_m = 1.0 + (scramble((step / 100) as u64) % 4) as f64;
        for axis in 0..2 {
            at[axis] += STEP_S * command[axis];
        }
        at[0] += STEP_S * 0.002 * tide_m;
        tide_m
    })
}

fn study(table: &DataTable) -> RobotStudy {
    let node = proto::config::parse("kind = 'point-mass'").unwrap();
    let spec = &robotsim::dynamics::SPEC;
    let dynamics =
        proto::config::check(&node, "", spec, &Catalogue::built_in().lists(), &mut Vec::new())
            .table;
    let robots = robots::read(table).unwrap();
    RobotStudy::new(robots, &dynamics, StatedSettings::default(), (&Choices::default(), table))
        .unwrap()
}

fn index(study: &RobotStudy, name: &str) -> TermId {
    study.candidates().find(|candidate| candidate.name == name).unwrap()
}

/// The mean of what follows the tide is `wind` to begin with. What follows it explains the mean, too.
#[test]
fn what_no_effect_explains_is_one_thing_with_its_mean() {
    let study = study(&carried(6000));
    let search = Search::new(&study, &|_| {});
    let ladder = search.stepwise_selection();
    let names = |terms: &[TermId]| -> Vec<String> {
        terms.iter().map(|&term| study.candidates()[term].name.clone()).collect()
    };
    assert_eq!(names(&ladder.accepted), ["curve:tide_m"]);
    let wind = study.fit(&[index(&study, "wind")], &study.fitted_rows(), Level::Time, None);
    let found = search.full_fit(&ladder.accepted, COMMON, None);
    let likelihoods = [study.configured(), &wind, &found].map(|fit| study.log_likelihood(fit));
    assert!(likelihoods[0] + 100.0 < likelihoods[1], "{likelihoods:?}");
    assert!(likelihoods[1] + 50.0 < likelihoods[2], "{likelihoods:?}");
    let measurements = Measurements {
        subject: Subject::Robots,
        error_unit: "m",
        searched: None,
        account: &DataAccount::default(),
    };
    let left = scan::scan_residuals(&study, &search, &ladder);
    let diagnosis = answer(&study, &search, &ladder, measurements, &left, None);
    let curves = diagnosis.candidates.iter().filter(|it| it.effect == "curve:tide_m");
    assert_eq!(curves.map(|curve| curve.accepted).collect::<Vec<_>>(), [true]);
    assert!(diagnosis.missing.is_empty(), "{:?}", diagnosis.missing);
}
