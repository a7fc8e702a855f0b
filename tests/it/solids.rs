//! Robots that go through walls, as results tell of it.

use serde_json::Value;
use std::path::Path;
use tests::{orchestrator, said};

/// Two robots that go east at 5 m/s for 4 s, 5 m apart, the northern one 2 m above the ground. What it comes to.
fn summary(folder: &Path, more: &str) -> Value {
    std::fs::create_dir_all(folder).unwrap();
    std::fs::write(folder.join("places.csv"), "agent,x_m,y_m,z_m\n0,0,0,0\n1,0,5,2\n").unwrap();
    let path = folder.join("x.toml");
    let text = format!(
        "[experiment]\nname = \"x\"\nseed = 1\nduration_s = 4.0\nagents = 2\n\
         [robotsim]\nscenario = {{ kind = \"csv\", file = \"places.csv\" }}\n\
         controller = {{ kind = \"constant-velocity\", velocity_mps = [5.0, 0.0] }}\n{more}\
         [netsim.phy]\npropagation = \"unit-disk\"\nradius_m = 10.0\n"
    );
    std::fs::write(&path, text).unwrap();
    let output = orchestrator(&["run", path.to_str().unwrap()], folder);
    assert!(output.status.success(), "{}", said(&output));
    let text = std::fs::read_to_string(folder.join("runs/x/summary.json")).unwrap();
    serde_json::from_str(&text).unwrap()
}

/// A wall across both ways, a lower one, one beside them, and a cart that meets the southern robot head-on.
const SITE: &str = "[[robotsim.obstacle]]\nname = \"cart\"\npath_m = [[-40.0, 0.0]]\nspeed_mps = 10.0\n\
    [[site.wall]]\nfrom_m = [3.0, -9.0]\nto_m = [3.0, 9.0]\n\
    [[site.wall]]\nfrom_m = [9.0, -9.0]\nto_m = [9.0, 9.0]\nheight_m = 1.5\n\
    [[site.wall]]\nfrom_m = [0.0, 5.15]\nto_m = [20.0, 5.15]\n\
    [[site.obstacle]]\nname = \"cart\"\ncentre_m = [20.0, 0.0]\nradius_m = 1.0\n";

#[test]
fn walls_that_robots_go_through_are_counted_and_warned_of() {
    let folder = tests::folder();
    let warning = |of_it: &Value| {
        let warnings = of_it["warnings"].as_array().unwrap().iter();
        warnings.filter_map(Value::as_str).find(|text| text.contains("contacts")).map(str::to_owned)
    };
    let through = summary(&folder.path().join("through"), SITE);
    assert_eq!(through["task"]["site_collisions"], 4);
    assert_eq!(
        warning(&through).unwrap(),
        "robots went into or through walls and obstacles of [site] 4 times, since contacts are not resolved: \
         robotsim.contacts.kind = \"resolve\" makes walls and obstacles solid"
    );
    let resolved = format!("contacts.kind = \"resolve\"\n{SITE}");
    let resolved = summary(&folder.path().join("resolved"), &resolved);
    assert_eq!((&resolved["task"]["site_collisions"], warning(&resolved)), (&0.into(), None));
    let nowhere = summary(&folder.path().join("nowhere"), "");
    assert_eq!((nowhere["task"].get("site_collisions"), warning(&nowhere)), (None, None));
}
