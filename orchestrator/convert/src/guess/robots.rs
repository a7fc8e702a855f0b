//! Logs of robots: where they were, and what they were commanded to do.

use super::places;
use super::profile::Profile;
use super::times::{self, Rate, quoted};
use super::words::{COMMAND, ROBOT, TIME};
use super::write::model_of_robots;
use super::{Asked, Draft, DraftInput, Log};
use crate::tables::TableKind;

/// What a table of robots can be made of.
///
/// # Errors
///
/// What is lacking; empty if the logs have nothing of robots.
pub(super) fn draft(logs: &[Log], asked: &mut Asked<'_>) -> Result<Draft, String> {
    let place_of = |log: &Log| places::find(log, |p| !p.has(COMMAND));
    let with_place = logs.iter().enumerate().find_map(|(at, log)| Some((at, place_of(log)?)));
    let Some((at, place)) = with_place else {
        let has_commands = logs.iter().any(|log| command(log, true).is_some());
        return Err(if has_commands {
            "robots need their measured positions (x and y, or latitude and longitude) as well as commands; give the file with the poses, too".to_owned()
        } else {
            "robots need columns of positions (x and y) and of commands".to_owned()
        });
    };
    let log = &logs[at];
    let mut draft = Draft {
        table: TableKind::Robots,
        inputs: vec![DraftInput::new(at)],
        top: Vec::new(),
        findings: Vec::new(),
        unknown: Vec::new(),
        model: String::new(),
    };
    let is_place = |p: &Profile| place.columns().any(|column| log.profile(column).name == p.name);
    let own = command(log, false);
    let further = logs
        .iter()
        .enumerate()
        .filter(|(other, _)| *other != at)
        .find_map(|(at, log)| Some((at, command(log, true)?)));
    if own.is_none() && further.is_none() {
        return Err(format!(
            "{} has positions, but no commands (velocities, speed and yaw rate or steering, accelerations, or thrust and attitude): without \
             them no motion can be predicted. Give the file with the commands, too, or name the column in a mapping file",
            log.files
        ));
    }
    let input = &mut draft.inputs[0];
    if times::fill(log, input, "time_s", Rate::Robots, asked, |p| !is_place(p)).is_none() {
        return Err(format!("{} has positions and commands, but no column of times", log.files));
    }
    let agent = log.best(|p| {
        let is_named =
            p.has(ROBOT) || p.has(&["id", "name", "frame"]) && !p.has(&["seq", "header", "msg"]);
        if p.is_label()
            && !p.has(TIME)
            && !is_place(p)
            && p.n_distinct < 1000
            && is_named
            && (p.has(ROBOT) || p.words.len() < 3)
        {
            1 + i32::from(p.has(ROBOT))
        } else {
            0
        }
    });
    match agent {
        Some(agent) => {
            let profile = log.profile(agent);
            input.add("agent", quoted(&profile.name), format!("{} names", profile.n_distinct));
        }
        None => input.add("agent", "0", "no column names the robot: one, number 0"),
    }
    if place.is_geographic {
        for (name, column) in ["latitude_deg", "longitude_deg"].into_iter().zip(place.columns()) {
            input.add(name, super::links::geographic(log.profile(column)), "degrees");
        }
        let height = log.best(|p| {
            i32::from(p.is_numeric() && p.has(&["alt", "altitude", "height"]) && !p.has(COMMAND))
        });
        if let Some(height) = height {
            input.add("z_m", quoted(&log.profile(height).name), "height");
        }
    } else {
        let (unit, reason) = places::unit(log, &place, asked, "unit-of-positions");
        places::add(
            log,
            input,
            &place,
            "",
            unit,
            &reason.unwrap_or_else(|| format!("{unit}, as no name says otherwise")),
        );
    }
    heading(log, input, asked);
    let (kind, columns) =
        own.or_else(|| further.as_ref().map(|(_, found)| found.clone())).unwrap_or_default();
    let target = match &further {
        Some((other, _)) if command(log, false).is_none() => {
            let other = *other;
            let mut second = DraftInput::new(other);
            if times::fill(&logs[other], &mut second, "time_s", Rate::Robots, asked, |_| true)
                .is_none()
            {
                return Err(format!(
                    "{} has commands, but no column of times by which they join the positions",
                    logs[other].files
                ));
            }
            draft.inputs.push(second);
            1
        }
        _ => 0,
    };
    let of = draft.inputs[target].log;
    for (name, column) in columns {
        let profile = logs[of].profile(column);
        let source = angle(profile, name);
        let reason = format!("from {} to {}", rounded(profile.range[0]), rounded(profile.range[2]));
        draft.inputs[target].add(name, source, reason);
    }
    super::links::covariates(log, &mut draft, &[]);
    draft.model = model_of_robots(kind);
    Ok(draft)
}

/// Four digits of a number.
fn rounded(value: f64) -> f64 {
    format!("{value:.3e}").parse().unwrap_or(value)
}

/// The source of a column that may be in degrees.
fn angle(profile: &Profile, name: &str) -> String {
    let is_angle = name.ends_with("_rad") || name.ends_with("_radps");
    let most = profile.range[0].abs().max(profile.range[2].abs());
    let limit = if name == "cmd_steer_rad" {
        1.6
    } else if name.ends_with("_radps") {
        30.0
    } else {
        7.0
    };
    let unit = if name.ends_with("_radps") { "degps" } else { "deg" };
    let is_stated = profile.unit.is_some_and(|unit| unit.fits(name));
    if is_angle && !is_stated && limit < most {
        format!("{{ column = {}, unit = \"{unit}\" }}", quoted(&profile.name))
    } else {
        quoted(&profile.name)
    }
}

/// Fills the heading: an angle, or a quaternion.
fn heading(log: &Log, input: &mut DraftInput, asked: &mut Asked<'_>) {
    let part = |axis: &str| {
        log.best(|p| {
            let is_rotation =
                p.has(&["q", "quat", "quaternion", "orientation", "rotation"]) && !p.has(COMMAND);
            let is_short = p.words.len() == 1 && p.words[0] == format!("q{axis}");
            let is_part = p.words.last().is_some_and(|last| last == axis) || is_short;
            i32::from(
                p.is_numeric()
                    && is_part
                    && (is_rotation || is_short)
                    && p.range[2] <= 1.001
                    && -1.001 <= p.range[0],
            )
        })
    };
    if let [Some(x), Some(y), Some(z), Some(w)] = ["x", "y", "z", "w"].map(part) {
        let names: Vec<String> =
            [x, y, z, w].map(|column| quoted(&log.profile(column).name)).into();
        input.add("heading_rad", format!("[{}]", names.join(", ")), "a quaternion");
        return;
    }
    let column = log.best(|p| {
        let is_heading = p.is_numeric()
            && !p.has(COMMAND)
            && !p.has(&["rate", "dot", "velocity", "vel", "std", "acc"]);
        if !is_heading {
            0
        } else if p.has(&["yaw", "heading", "theta", "psi", "azimuth", "course", "bearing"]) {
            3
        } else {
            i32::from(p.has(&["orientation", "angle"]))
        }
    });
    let Some(column) = column else { return };
    let profile = log.profile(column);
    let most = profile.range[0].abs().max(profile.range[2].abs());
    let is_compass = profile.has(&["azimuth", "course", "bearing", "compass"])
        || profile.has(&["heading"]) && 180.0 < most && 0.0 <= profile.range[0];
    let name = quoted(&profile.name);
    let unit = if most <= 7.0 { "rad" } else { "deg" };
    if is_compass && most > 7.0 {
        let text = format!("Does {} count from north, clockwise, as a compass does?", profile.name);
        let choices = [
            ("compass", "0 is north, 90 is east"),
            ("mathematical", "0 is east (+x), 90 is north (+y)"),
        ];
        if asked.ask("heading", text, &choices, 0) == "compass" {
            let half_turn = std::f64::consts::FRAC_PI_2;
            let source =
                format!("{{ column = {name}, unit = \"deg\", scale = -1, offset = {half_turn} }}");
            input.add("heading_rad", source, "a compass: clockwise from north, in degrees");
            return;
        }
    }
    let stated = profile.unit.filter(|unit| unit.fits("heading_rad"));
    let source = if stated.is_some() || unit == "rad" {
        name
    } else {
        format!("{{ column = {name}, unit = \"deg\" }}")
    };
    input.add(
        "heading_rad",
        source,
        format!("{} to {}: {unit}", rounded(profile.range[0]), rounded(profile.range[2])),
    );
}

/// Columns of commands: what kind of command, and the columns of the table with those of the log.
type Command = (&'static str, Vec<(&'static str, usize)>);

/// The commands of a log.
///
/// * `is_alone`: the log has nothing else, so its columns need no word for commands.
fn command(log: &Log, is_alone: bool) -> Option<Command> {
    let is_command = |p: &Profile| {
        p.is_numeric() && (is_alone || p.has(COMMAND)) && !p.has(&["covariance", "std"])
    };
    let axis = |p: &Profile, axis: &str| p.words.last().is_some_and(|last| last == axis);
    let short = |p: &Profile, names: &[&str]| p.words.iter().any(|word| names.contains(&&**word));
    let find = |fits: &dyn Fn(&Profile) -> bool| log.best(|p| i32::from(is_command(p) && fits(p)));
    let along = |name: &str| {
        let of = format!("v{name}");
        find(&|p| {
            let is_linear = p.has(&["velocity", "vel", "linear", "v", "speed"])
                && !p.has(&["angular", "acc", "acceleration"]);
            short(p, &[&of]) || is_linear && axis(p, name)
        })
    };
    let turn = find(&|p| {
        short(p, &["omega", "yawrate", "w", "wz", "turn"])
            || p.has(&["angular"]) && axis(p, "z")
            || p.has(&["yaw"]) && p.has(&["rate", "dot", "speed"])
    });
    let steer = find(&|p| p.has(&["steer", "steering", "delta"]));
    let speed = find(&|p| {
        let is_speed = p.has(&["speed", "throttle"])
            || short(p, &["v"]) && p.words.len() <= 2
            || p.has(&["velocity", "vel"]);
        is_speed && !p.has(&["angular", "yaw", "steering", "y", "z"])
    });
    let (vx, vy, vz) = (along("x"), along("y"), along("z"));
    if let Some((speed, steer)) = speed.or(vx).zip(steer) {
        return Some(("car", vec![("cmd_speed_mps", speed), ("cmd_steer_rad", steer)]));
    }
    let is_still =
        |column: usize| log.profile(column).is_constant() && log.profile(column).range[1] == 0.0;
    if let Some((speed, turn)) = vx.or(speed).zip(turn)
        && vy.is_none_or(is_still)
    {
        return Some(("unicycle", vec![("cmd_speed_mps", speed), ("cmd_yaw_rate_radps", turn)]));
    }
    if let Some((vx, vy)) = vx.zip(vy) {
        let mut columns = vec![("cmd_vx_mps", vx), ("cmd_vy_mps", vy)];
        columns.extend(vz.map(|vz| ("cmd_vz_mps", vz)));
        return Some(("velocity", columns));
    }
    let acceleration = |name: &str| {
        let of = format!("a{name}");
        find(&|p| short(p, &[&of]) || p.has(&["acc", "acceleration", "accel"]) && axis(p, name))
    };
    // Without a word for commands, accelerations are measured ones.
    if !is_alone && let Some((ax, ay)) = acceleration("x").zip(acceleration("y")) {
        let mut columns = vec![("cmd_ax_mps2", ax), ("cmd_ay_mps2", ay)];
        columns.extend(acceleration("z").map(|az| ("cmd_az_mps2", az)));
        return Some(("acceleration", columns));
    }
    let attitude = |name: &'static str| find(&|p| p.has(&[name]) && !p.has(&["rate"]));
    if let (Some(thrust), Some(roll), Some(pitch), Some(yaw)) =
        (find(&|p| p.has(&["thrust"])), attitude("roll"), attitude("pitch"), attitude("yaw"))
        && !is_alone
    {
        let columns = vec![
            ("cmd_thrust_n", thrust),
            ("cmd_roll_rad", roll),
            ("cmd_pitch_rad", pitch),
            ("cmd_yaw_rad", yaw),
        ];
        return Some(("thrust", columns));
    }
    None
}
