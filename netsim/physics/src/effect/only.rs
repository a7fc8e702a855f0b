//! Effects that act on some links only: the table `only` of a `[[netsim.phy.effect]]`.

use super::formula::{NAMES, Read, covariate};
use super::{Common, Curve, Effect, Scatter};
use crate::link::{Link, Scene};
use proto::config::{Problem, Section};
use proto::effect::Named;
use proto::effect::only::{self, Limits, MOST_ENTRIES, Span};
use std::ops::RangeInclusive;

/// The links on which an effect acts: all keys given must hold.
#[derive(Section)]
pub(super) struct Keys {
    /// Numbers of nodes: the effect acts on frames that one of them sends or receives.
    #[key(length = 1..=MOST_ENTRIES)]
    nodes: Option<Vec<u32>>,
    #[key(flatten)]
    span: Span,
    /// Condition on the link, such as "distance_m > 30 and temperature_c > 25". It compares expressions by < <= > >= == !=, joined by and,
    /// or, not, and uses the names of the effect formula (distance_m, channel, time_s, tx, rx, …), columns of the measurements and
    /// covariates of the robots. The effect does not act where a missing value decides.
    #[key(name = "where")]
    condition: Option<String>,
}

/// What limits an effect.
type Only = only::Only<Read>;

/// Reads the table `only` of a checked effect that stands at `path`, if it has one without problems.
fn read(effect: &toml::Table, path: &str, problems: &mut Vec<Problem>) -> Option<Only> {
    let Keys { nodes, span, condition } = Common::read(effect).only?;
    let limits = Limits { members: ("nodes", nodes), span, condition };
    only::read(limits, path, &NAMES, problems)
}

/// Adds what is wrong with the table `only` of a checked effect that stands at `path`.
pub(super) fn check(effect: &toml::Table, path: &str, problems: &mut Vec<Problem>) {
    read(effect, path, problems);
}

/// A table `only` as a program writes it, checked. `path`: of the effect, for problems.
pub fn checked(limits: &toml::Table, path: &str, problems: &mut Vec<Problem>) -> toml::Table {
    only::checked(limits, &Keys::SPEC, check, path, problems)
}

/// The effect where its checked table limits it, and as it is where not. Nothing where the limits are wrong.
pub(super) fn limited(effect: Box<dyn Effect>, table: &toml::Table) -> Option<Box<dyn Effect>> {
    if !table.contains_key(only::KEY) {
        return Some(effect);
    }
    let only = read(table, "", &mut Vec::new())?;
    Some(Box::new(Limited { effect, only }))
}

/// Columns of measurements, or covariates of robots, that the table `only` of an effect names.
#[must_use]
pub fn columns(effect: &toml::Table) -> Vec<String> {
    let effect = only::checked_within(effect, &Keys::SPEC);
    let only = read(&effect, "", &mut Vec::new());
    let is_column = |name: &&String| !NAMES.iter().any(|(known, _)| known == name);
    only.iter().flat_map(|only| only.names().iter().filter(is_column)).cloned().collect()
}

/// An effect that acts on some links only.
///
/// # Model
///
/// That of the effect where all keys of its table hold, and nothing elsewhere. Whether they do is decided for each frame, by its sender,
/// receiver, channel and begin. Random variation keeps its draws: a value that is drawn once per link is the same whenever it acts.
#[derive(Debug)]
struct Limited {
    effect: Box<dyn Effect>,
    only: Only,
}

impl Named for Limited {
    fn name(&self) -> &'static str {
        self.effect.name()
    }
}

impl Effect for Limited {
    fn acts_on(&self, link: &Link<'_>) -> bool {
        self.only.concerns(&[link.sender.id.0, link.receiver.id.0])
            && self.only.acts_in(link.scene.run)
            && self.only.acts_at_ns(link.time_ns)
            && self.only.holds(|read| read(link), |name| covariate(link, name))
    }

    fn is_limited(&self) -> bool {
        true
    }

    fn band_hz(&self) -> Option<RangeInclusive<f64>> {
        self.effect.band_hz()
    }

    fn needs_heights(&self) -> bool {
        self.effect.needs_heights()
    }

    fn contribution_db(&self, link: &Link<'_>) -> f64 {
        if self.acts_on(link) { self.effect.contribution_db(link) } else { 0.0 }
    }

    fn max_gain_db(&self) -> f64 {
        // Where it does not act, it takes nothing away.
        self.effect.max_gain_db().max(0.0)
    }

    fn scatter(&self) -> Option<Scatter> {
        self.effect.scatter()
    }

    fn curve_shift_db(&self, link: &Link<'_>) -> f64 {
        if self.acts_on(link) { self.effect.curve_shift_db(link) } else { 0.0 }
    }

    fn curve(&self) -> Option<&dyn Curve> {
        self.effect.curve()
    }

    fn loss(&self, link: &Link<'_>) -> f64 {
        if self.acts_on(link) { self.effect.loss(link) } else { 0.0 }
    }

    fn loss_at(&self, link: &Link<'_>, rssi_dbm: f64) -> f64 {
        if self.acts_on(link) { self.effect.loss_at(link, rssi_dbm) } else { 0.0 }
    }

    fn register_dbm(&self, link: &Link<'_>, register_dbm: f64) -> f64 {
        if self.acts_on(link) { self.effect.register_dbm(link, register_dbm) } else { register_dbm }
    }

    fn prepare(&self, scene: &mut Scene<'_>) {
        self.effect.prepare(scene);
    }
}

#[cfg(test)]
mod tests {
    use super::columns;
    use crate::effect::testing::{along_x, made, over_friis, problems};
    use crate::effect::{Effect, build};
    use crate::link::{Covariates, Link, Scene};
    use crate::model::Model;
    use crate::propagation::{Radio, friis::Friis};
    use crate::reception::table::Table;
    use proto::ids::MoteId;
    use proto::types::Covariate;

    fn gain(only: &str) -> Box<dyn Effect> {
        made("system-gain", &format!("gain_db = -6.0\nonly = {only}"))
    }

    /// Whether an effect acts on a link of 10 m from node 0 to node 1 on channel 15 that is changed so.
    fn acts(effect: &dyn Effect, change: impl Fn(&mut Link<'_>), scene: &Scene<'_>) -> bool {
        let mut link = along_x(10.0, 1.0, Some(15), scene);
        change(&mut link);
        let db = effect.contribution_db(&link);
        assert_eq!(db, if effect.acts_on(&link) { -6.0 } else { 0.0 });
        effect.acts_on(&link)
    }

    #[test]
    fn it_acts_where_every_key_holds_and_nowhere_else() {
        let scene = Scene::default();
        let nodes = gain("{ nodes = [1, 5] }");
        assert!(acts(&*nodes, |_| {}, &scene));
        assert!(acts(
            &*nodes,
            |link| (link.sender.id, link.receiver.id) = (MoteId(5), MoteId(0)),
            &scene
        ));
        assert!(!acts(&*nodes, |link| link.receiver.id = MoteId(2), &scene));
        let span = gain("{ from_s = 1800.1, until_s = 3600.3 }");
        for (time_ns, expected) in [
            (1_800_099_000_000, false),
            (1_800_100_000_000, true),
            (3_600_299_000_000, true),
            (3_600_300_000_000, false),
            // Times of measurements are cast.
            ((1800.1 * 1e9) as u64, true),
            ((3600.3 * 1e9) as u64, false),
        ] {
            assert_eq!(acts(&*span, |link| link.time_ns = time_ns, &scene), expected, "{time_ns}");
        }
        let channel = gain("{ where = 'channel >= 15 and distance_m < 20' }");
        assert!(acts(&*channel, |_| {}, &scene));
        assert!(!acts(&*channel, |link| link.channel = Some(14), &scene));
        assert!(!acts(&*channel, |link| link.distance_m = 20.0, &scene));
        assert!(!acts(&*channel, |link| link.channel = None, &scene));
        let directed = gain("{ where = 'tx == 0 and rx != 2', nodes = [0] }");
        assert!(acts(&*directed, |_| {}, &scene));
        assert!(!acts(&*directed, |link| link.receiver.id = MoteId(2), &scene));
        assert!(!acts(
            &*directed,
            |link| (link.sender.id, link.receiver.id) = (MoteId(1), MoteId(0)),
            &scene
        ));
    }

    #[test]
    fn runs_and_covariates_are_those_of_the_row_or_of_the_agents() {
        let in_run = |run| Scene { run, ..Scene::default() };
        let second = gain("{ runs = [2] }");
        assert!(acts(&*second, |_| {}, &in_run(Some(2))));
        assert!(!acts(&*second, |_| {}, &in_run(Some(1))));
        assert!(!acts(&*second, |_| {}, &in_run(None)));
        let warm = gain("{ where = 'temperature_c > 30' }");
        let row = |value: f64| [("temperature_c".to_owned(), value)];
        for (value, expected) in [(31.0, true), (30.0, false)] {
            let row = row(value);
            let scene = Scene { covariates: Covariates::Row(&row), ..Scene::default() };
            assert_eq!(acts(&*warm, |_| {}, &scene), expected);
            let agents = [Covariate { name: "temperature_c".to_owned(), values: vec![value; 2] }];
            let scene = Scene { covariates: Covariates::Agents(&agents), ..Scene::default() };
            assert_eq!(acts(&*warm, |_| {}, &scene), expected);
        }
        assert!(!acts(&*warm, |_| {}, &Scene::default()));
        let table = "only = { where = 'temperature_c > 30 and tx == 1' }".parse().unwrap();
        assert_eq!(columns(&table), ["temperature_c"]);
    }

    #[test]
    fn every_part_of_an_effect_is_limited() {
        let scene = Scene::default();
        let [here, there] = [[0, 1], [0, 2]].map(|[tx, rx]| {
            let mut link = along_x(10.0, 1.0, Some(15), &scene);
            (link.sender.id, link.receiver.id) = (MoteId(tx), MoteId(rx));
            link
        });
        let only = "\nonly = { nodes = [1] }";
        let floor = made("noise-floor", &format!("shift_db = -4.0{only}"));
        assert_eq!([&here, &there].map(|link| floor.curve_shift_db(link)), [-4.0, 0.0]);
        assert_eq!(floor.max_gain_db(), 4.0);
        let loss = made("formula", &format!("expression = '0.25'\ntarget = 'loss'{only}"));
        assert_eq!([&here, &there].map(|link| loss.loss_at(link, -60.0)), [0.25, 0.0]);
        let register = made("system-gain", &format!("gain_db = 3.0\nregister_only = true{only}"));
        assert_eq!([&here, &there].map(|link| register.register_dbm(link, -60.0)), [-57.0, -60.0]);
        let curve = made("reception-curve", &format!("p50_dbm = -60.0\nwidth_db = 1.0{only}"));
        let limited = over_friis(Some(curve));
        let plain = over_friis(None);
        let everywhere =
            over_friis(Some(made("reception-curve", "p50_dbm = -60.0\nwidth_db = 1.0")));
        let passes = |model: &Model, link: &Link<'_>| model.evaluate(link).reception_probability;
        assert_eq!(passes(&limited, &here), passes(&everywhere, &here));
        assert_eq!(passes(&limited, &there), passes(&plain, &there));
        assert_ne!(passes(&limited, &here), passes(&plain, &here));
        let least = |model: &Model| model.reception_curve().floor_dbm();
        assert_eq!(limited.floor_dbm(), least(&plain).min(least(&everywhere)));
    }

    #[test]
    fn links_may_reach_as_far_as_with_and_without_it() {
        for (gain_db, expected_db) in [(6.0, 6.0), (-6.0, 0.0)] {
            let keys = format!("gain_db = {gain_db:?}\nonly = {{ nodes = [1] }}");
            let effect = made("system-gain", &keys);
            assert_eq!(effect.max_gain_db(), expected_db);
            assert!(!effect.is_isotropic());
        }
        assert!(made("system-gain", "gain_db = 6.0").is_isotropic());
    }

    #[test]
    fn several_effects_of_one_kind_act_each_on_its_own_links_and_draw_apart() {
        let tables = ["{ nodes = [1] }", "{ nodes = [2] }"].map(|only| {
            format!("kind = 'shadowing'\nsd_db = 4.0\ndecorrelation_m = 5.0\nonly = {only}")
                .parse::<toml::Table>()
                .unwrap()
        });
        let effects = build(&tables, &crate::catalogue::Catalogue::built_in().effects);
        let radio = Radio {
            tx_power_dbm: 0.0,
            tx_antenna_gain_dbi: 0.0,
            rx_antenna_gain_dbi: 0.0,
            carrier_hz: 2.44e9,
        };
        let table = Box::new(Table::dust());
        let model = Model::new(Box::new(Friis { radio }), effects, table, radio, 0.1, Some(1.0));
        assert_eq!((model.scatters().len(), model.unlimited_scatters().len()), (3, 1));
        assert!(model.symmetric_scatters().is_empty() && !model.is_isotropic());
        let scene = Scene::default();
        let ordinals = |tx, rx| {
            let mut link = along_x(10.0, 1.0, Some(15), &scene);
            (link.sender.id, link.receiver.id) = (MoteId(tx), MoteId(rx));
            model.limited_scatters(&link).map(|scatter| scatter.ordinal).collect::<Vec<_>>()
        };
        assert_eq!(ordinals(0, 1), [0]);
        assert_eq!(ordinals(2, 0), [1]);
        assert_eq!(ordinals(1, 2), [0, 1]);
        assert_eq!(ordinals(3, 4), [0; 0]);
    }

    #[test]
    fn what_is_wrong_with_it_is_refused_at_its_place() {
        for (only, expected) in [
            (
                "{ agents = [1] }",
                "effect[0].only.agents: is not a known key (nearest valid: nodes)",
            ),
            ("{ nodes = [] }", "effect[0].only.nodes: must have 1 to 10000 entries, got []"),
            (
                "{ from_s = 5, until_s = 4 }",
                "effect[0].only.until_s: must be greater than from_s = 5",
            ),
            (
                "{ where = 'chanel > 12' }",
                "effect[0].only.where: unknown name chanel; did you mean channel?",
            ),
        ] {
            let problems = problems("system-gain", &format!("gain_db = 1.0\nonly = {only}"));
            assert!(problems.contains(expected), "{only}: {problems}");
        }
    }
}
