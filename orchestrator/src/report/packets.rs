//! The page of a network against measured packets: each figure among those of seeds, each mote's delivery.

use super::figures::HALF;
use super::measured::{Picture, begin, figures, half, words};
use super::svg::{Axis, Chart};
use super::text::escape;
use numbers::format::{capitalised, count, number};
use serde_json::Value;
use std::fmt::Write as _;

/// The page. `json`: `compare/1` or `diagnose/1` of kind `network`; `command`: what makes this page again.
#[must_use]
pub fn page(config: &str, command: &str, json: &Value) -> String {
    let is_diagnosis = json["schema"] == "diagnose/1";
    let title = format!(
        "{}: {config} against {}",
        if is_diagnosis { "Diagnosis" } else { "Comparison" },
        json["data"]["file"].as_str().unwrap_or("measurements")
    );
    let mut page = begin(&title);
    let _ = write!(
        page,
        "<header>\n<h1>{}</h1>\n<p class=\"lead\">{} {}, {} used; the network was run under {} seeds. A measurement is one run whose chances fell in one way: the question is whether it could be one of the model's.</p>\n</header>\n",
        escape(&title),
        count(json["rows"].as_u64().unwrap_or(0)),
        if json["kind"] == "task" { "places" } else { "packets" },
        count(json["used"].as_u64().unwrap_or(0)),
        json["seeds"],
    );
    if let Some(sentence) = json["sentence"].as_str() {
        let _ = writeln!(page, "<p class=\"verdict\">{}</p>", escape(&capitalised(sentence)));
    }
    words::notices(&mut page, json);
    if is_diagnosis {
        candidates(&mut page, json);
        words::ties(&mut page, json);
    }
    table(&mut page, json);
    split(&mut page, json);
    figures(
        &mut page,
        "Figure by figure",
        "Dots are seeds of the model, from the least to the greatest; the line is what was measured. A line amid the dots is no news. \
         One beyond them is what the model has no run for.",
        &list(&json["kpis"]).filter_map(kpi).collect::<Vec<_>>(),
    );
    let motes: Vec<Picture> = delivery(json).into_iter().collect();
    figures(&mut page, "Mote by mote", "", &motes);
    let _ = write!(
        page,
        "<h2>Again</h2>\n<p><code>{}</code></p>\n</main>\n</body>\n</html>\n",
        escape(command)
    );
    page
}

fn list(value: &Value) -> impl Iterator<Item = &Value> {
    value.as_array().into_iter().flatten()
}

fn of(value: &Value) -> f64 {
    value.as_f64().unwrap_or(f64::NAN)
}

fn table(page: &mut String, json: &Value) {
    let with: Vec<&Value> = list(&json["kpis_with"]).collect();
    let column = if with.is_empty() { "" } else { "<th class=\"n\">with what was found</th>" };
    let _ = writeln!(
        page,
        "<h2>All figures</h2>\n<table>\n<tr><th>figure</th><th>what it is</th><th class=\"n\">measured</th><th class=\"n\">model, 90 % of seeds</th>{column}<th>unit</th><th class=\"n\">p</th></tr>"
    );
    let range = |kpi: &Value| {
        format!("{} to {}", number(of(&kpi["model"]["low"])), number(of(&kpi["model"]["high"])))
    };
    for (k, kpi) in list(&json["kpis"]).enumerate() {
        let with = with
            .get(k)
            .map_or_else(String::new, |kpi| format!("<td class=\"n\">{}</td>", range(kpi)));
        let _ = writeln!(
            page,
            "<tr><td>{}</td><td>{}</td><td class=\"n\">{}</td><td class=\"n\">{}</td>{with}<td>{}</td><td class=\"n\">{}</td></tr>",
            escape(kpi["name"].as_str().unwrap_or_default()),
            escape(kpi["doc"].as_str().unwrap_or_default()),
            number(of(&kpi["measured"])),
            range(kpi),
            kpi["unit"].as_str().unwrap_or_default(),
            number(of(&kpi["p_value"])),
        );
    }
    page.push_str("</table>\n");
}

/// Where the error comes from, where that was asked.
fn split(page: &mut String, json: &Value) {
    let split = &json["error_split"];
    let Some(sentence) = split["sentence"].as_str() else { return };
    let mut parts: Vec<&str> = list(&split["order"]).filter_map(Value::as_str).collect();
    let heading = if json["kind"] == "task" {
        parts.push("neither");
        "Network or robot?"
    } else {
        "Robot, radio or protocol?"
    };
    let columns: String = parts.iter().map(|part| format!("<th class=\"n\">{part}</th>")).collect();
    let _ = writeln!(
        page,
        "<h2>{heading}</h2>\n<p>{}. {}.</p>\n<table>\n<tr><th>figure</th><th class=\"n\">measured</th><th class=\"n\">whole model</th>{columns}<th>unit</th></tr>",
        escape(&capitalised(sentence)),
        escape(&capitalised(split["note"].as_str().unwrap_or_default())),
    );
    for figure in list(&split["figures"]).filter(|figure| figure["measured"].is_number()) {
        let cell = |part: &&str| {
            let part = &figure["parts"][*part];
            let told = |key: &str| number(of(&part[key]));
            if part.is_null() {
                "<td class=\"n\">–</td>".to_owned()
            } else {
                format!(
                    "<td class=\"n\">{} ({} to {})</td>",
                    told("value"),
                    told("low"),
                    told("high")
                )
            }
        };
        let _ = writeln!(
            page,
            "<tr><td>{}</td><td class=\"n\">{}</td><td class=\"n\">{}</td>{}<td>{}</td></tr>",
            escape(figure["name"].as_str().unwrap_or_default()),
            number(of(&figure["measured"])),
            number(of(&figure["whole"])),
            parts.iter().map(cell).collect::<String>(),
            figure["unit"].as_str().unwrap_or_default(),
        );
    }
    page.push_str("</table>\n");
}

fn candidates(page: &mut String, json: &Value) {
    page.push_str("<h2>What was tried</h2>\n<p>Each candidate was run under the same seeds as the model; its gain is how much more probable these packets are with it. A chance below the level accepts it: that the model itself, without the effect, would give so great a gain.</p>\n<table>\n<tr><th>effect</th><th class=\"n\">gain (nats)</th><th class=\"n\">p</th><th>parameters</th><th>accepted</th></tr>\n");
    for entry in list(&json["candidates"]) {
        let parameters: Vec<String> = entry["parameters"]
            .as_object()
            .into_iter()
            .flatten()
            .map(|(name, it)| {
                format!(
                    "{name} = {} {} ({} to {})",
                    number(of(&it["value"])),
                    it["unit"].as_str().unwrap_or_default(),
                    number(of(&it["low"])),
                    number(of(&it["high"]))
                )
            })
            .collect();
        let _ = writeln!(
            page,
            "<tr><td>{}</td><td class=\"n\">{}</td><td class=\"n\">{}</td><td>{}</td><td>{}</td></tr>",
            escape(entry["effect"].as_str().unwrap_or_default()),
            number(of(&entry["gain"])),
            number(of(&entry["p_value"])),
            escape(&parameters.join(", ")),
            if entry["accepted"] == true { "yes" } else { "" },
        );
    }
    page.push_str("</table>\n");
}

/// Bounds with some room about them.
fn bounds(values: &[f64]) -> Option<[f64; 2]> {
    let low = values.iter().copied().fold(f64::INFINITY, f64::min);
    let high = values.iter().copied().fold(f64::NEG_INFINITY, f64::max);
    let room = 0.05 * (high - low).max(1e-3 * high.abs()).max(1e-6);
    (low <= high).then_some([low - room, high + room])
}

fn kpi(kpi: &Value) -> Option<Picture> {
    let name = kpi["name"].as_str()?;
    let measured = kpi["measured"].as_f64()?;
    let mut seeds: Vec<f64> = list(&kpi["model"]["seeds"]).filter_map(Value::as_f64).collect();
    seeds.sort_by(f64::total_cmp);
    let all: Vec<f64> = seeds.iter().copied().chain([measured]).collect();
    let [low, high] = bounds(&all)?;
    let unit = kpi["unit"].as_str().unwrap_or_default();
    let label = if unit.is_empty() { name.to_owned() } else { format!("{name} ({unit})") };
    let x = Axis::new("seeds, by this figure", -0.5, seeds.len() as f64 - 0.5).whole();
    let mut chart = half(x, Axis::new(&label, low, high));
    chart.dots("dot", seeds.iter().enumerate().map(|(k, &value)| [k as f64, value]));
    chart.level(measured, "measured");
    let below = seeds.iter().filter(|&&value| value < measured).count();
    let sentence = format!(
        "Measured {} {unit}; {below} of {} seeds lie below.",
        number(measured),
        seeds.len()
    );
    let svg = chart.finish(name, name, &sentence);
    Some(Picture {
        title: name.to_owned(),
        look: sentence,
        means: format!("It is {}.", kpi["doc"].as_str().unwrap_or_default()),
        key: vec![("dot", "seeds".to_owned())],
        svg,
        is_wide: false,
    })
}

fn delivery(json: &Value) -> Option<Picture> {
    let motes: Vec<&Value> = list(&json["motes"]).collect();
    let names: Vec<String> = motes.iter().map(|mote| mote["mote"].to_string()).collect();
    if motes.is_empty() {
        return None;
    }
    let x = Axis::new("mote", -0.5, motes.len() as f64 - 0.5).named(&names);
    let y = Axis::new("delivery", 0.0, 1.02).percent();
    let mut chart = Chart::new(x, y, 2.0 * HALF, super::figures::HALF_HEIGHT);
    for (k, mote) in motes.iter().enumerate() {
        let model = &mote["model"];
        let words = format!("mote {}: {} arrived of {}", names[k], mote["arrived"], mote["sent"]);
        chart.interval(
            k as f64,
            of(&model["mean"]),
            [of(&model["low"]), of(&model["high"])],
            &words,
        );
    }
    let measured = motes.iter().enumerate();
    chart.dots("point after", measured.map(|(k, mote)| [k as f64, of(&mote["delivery"])]));
    let outside = motes.iter().filter(|mote| mote["is_outside"] == true).count();
    let sentence = format!("{outside} of {} motes lie outside.", motes.len());
    let svg = chart.finish("delivery-by-mote", "Delivery by mote", &sentence);
    Some(Picture {
        title: "Delivery by mote".to_owned(),
        look: sentence,
        means: "About a tenth of the motes lie outside by chance alone; a few far outside are motes, or links, that the model has wrong."
            .to_owned(),
        key: vec![
            ("interval", "90 % of seeds".to_owned()),
            ("dot after", "measured".to_owned()),
        ],
        svg,
        is_wide: true,
    })
}
