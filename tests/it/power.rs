//! How large an effect a campaign would show.

use diagnose::power::answer::{self, Power, Size};
use diagnose::power::{PowerError, Question};
use diagnose::{Request, Unobserved};
use measure::config::Compared;
use measure::table::DataTable;
use study::choices::{Choices, SplitBy};
use tests::answers::{measurements, model};
use tests::campaign::{Campaign, Drive, Fleet, Layout};

fn asked(effect: &str) -> Question<'_> {
    Question { effect, with: &[], vary: None, campaigns: 6, seed: 1 }
}

fn power(
    (config, table): &(Compared, DataTable),
    choices: &Choices,
    question: &Question<'_>,
) -> Result<Power, PowerError> {
    let request = Request::new(config, table).with_choices(choices.clone());
    diagnose::power(&request, question, &Unobserved)
}

fn files(n_rows: usize) -> (Compared, DataTable) {
    let campaign = Campaign::link(4, &Layout::standard(), &[], n_rows);
    (model(&campaign.config_toml), measurements(&campaign.csv))
}

#[test]
fn a_larger_campaign_shows_a_smaller_effect() {
    let value = |n_rows: usize| {
        let found = power(&files(n_rows), &Choices::NONE, &asked("temperature")).unwrap();
        let text = answer::text(&found);
        assert_eq!((found.neutral, found.parameter.as_str()), (0.0, "db_per_c"), "{found:?}");
        assert!(text.contains("with a power of 80 %"), "{text}");
        let share = |size: &Size| size.found as f64 / size.campaigns as f64;
        let [Some(least), Some(greatest)] = [found.tried.first(), found.tried.last()] else {
            panic!("nothing was tried")
        };
        assert!(share(least) < 0.8 && 0.8 <= share(greatest), "{found:?}");
        found.value.unwrap().abs()
    };
    let (small, large) = (value(1000), value(5000));
    // Errors shrink with the root of the number of rows: by 2.2; each value is known to about 20 %.
    assert!((1.3..4.0).contains(&(small / large)), "{small} {large}");
    // At 5000 rows, 2 dB of noise and a temperature that varies by 3 degrees, an effect of 0.15 of the noise is faint.
    assert!((0.02..0.2).contains(&large), "{large}");
}

#[test]
fn what_these_data_cannot_show_is_said_at_once() {
    let files = files(1000);
    let refusal =
        |question: &Question<'_>| power(&files, &Choices::NONE, question).unwrap_err().to_string();
    let text = refusal(&asked("vegetation"));
    assert!(text.contains("needs foliage in [site]"), "{text}");
    let text = refusal(&asked("temprature"));
    assert!(text.contains("temperature"), "{text}");
    let text = refusal(&Question { vary: Some("db"), ..asked("temperature") });
    assert!(text.contains("db_per_c, reference_c"), "{text}");
    let with = ["reference_c".to_owned()];
    let text = refusal(&Question { with: &with, ..asked("temperature") });
    assert!(text.contains("--with"), "{text}");
}

#[test]
fn what_is_chosen_of_the_rows_is_judged_alone() {
    let files = files(5000);
    let found = |choices: &Choices| power(&files, choices, &asked("temperature"));
    let value = |choices: &Choices| found(choices).unwrap().value.unwrap().abs();
    let condition = |text: &str| Choices { condition: Some(text.to_owned()), ..Choices::NONE };
    // Two in nine, all along the time in which the temperature varies.
    let (few, all) = (value(&condition("tx < 4")), value(&Choices::NONE));
    assert!(1.3 < few / all, "{few} {all}");
    let text = found(&condition("tx == 300")).unwrap_err().to_string();
    assert!(text.contains("no row satisfies"), "{text}");
    let text =
        found(&Choices { split: Some(SplitBy::Run), ..Choices::NONE }).unwrap_err().to_string();
    assert!(text.contains("--split run"), "{text}");
}

#[test]
fn what_a_campaign_of_robots_would_show_is_told_too() {
    let campaign = Campaign::robots(3, &Fleet::standard(Drive::Velocity), &[], 3000);
    let files = (model(&campaign.config_toml), measurements(&campaign.csv));
    let found = power(&files, &Choices::NONE, &asked("slip")).unwrap();
    assert_eq!(found.neutral, 1.0, "{found:?}");
    let value = found.value.unwrap();
    // Positions are known to 1.5 cm and robots go 15 m in a window: a share of 1e-3 is 1.5 cm. Some hundred independent windows
    // show a fraction of that, but not a hundredth of it.
    assert!((1e-5..1e-3).contains(&(value - 1.0).abs()), "{value}");
}
