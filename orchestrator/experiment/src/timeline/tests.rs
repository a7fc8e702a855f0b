use super::*;

fn parse_timeline(text: &str) -> (Timeline, Vec<String>) {
    let mut problems = Vec::new();
    let tree = proto::config::parse(text).unwrap();
    let (timeline, _) = read(&tree, Some(5), Some(60.0), &mut problems);
    (timeline, problems.iter().map(ToString::to_string).collect())
}

#[test]
fn no_timeline_orders_nothing() {
    assert_eq!(parse_timeline(""), (Timeline::default(), Vec::new()));
}

#[test]
fn orders_are_given_in_the_step_that_contains_their_time() {
    let text = "\
[[timeline]]
at_s = 2.0
order = \"revive\"
motes = 3
[[timeline]]
at_s = 1.0
order = \"kill\"
motes = [3, 4]
[[timeline]]
at_s = 1.5
order = \"jam\"
channels = [11, 26]
until_s = 100.0
x_m = 1.0
radius_m = 4.0
[[timeline]]
at_s = 1.0
order = \"send\"
motes = 1
destination = \"all\"
payload_hex = \"00fF\"
";
    let (timeline, problems) = parse_timeline(text);
    assert_eq!(problems, Vec::<String>::new());
    // The robots start at 10 s.
    let start_ns = 10 * NS_PER_S;
    let commands_from = |from_s: u64| {
        let from_ns = from_s * NS_PER_S;
        let commands = timeline.commands(start_ns, from_ns, from_ns + NS_PER_S);
        assert!(commands.iter().all(|command| command.source == SOURCE));
        commands.into_iter().map(|command| command.order).collect::<Vec<_>>()
    };
    assert_eq!(commands_from(10), []);
    let jam = |channel| MoteOrder::Jam {
        channel,
        from_ns: 11_500_000_000,
        until_ns: 110 * NS_PER_S,
        centre_m: [1.0, 0.0],
        radius_m: 4.0,
    };
    let payload = vec![0, 0xff].into();
    let send = MoteOrder::Send { mote: 1, destination: u32::MAX, payload };
    assert_eq!(commands_from(11), [MoteOrder::Kill(3), MoteOrder::Kill(4), send, jam(11), jam(26)]);
    assert_eq!(commands_from(12), [MoteOrder::Revive(3)]);
    assert_eq!(commands_from(13), []);
}

#[test]
fn noise_without_channels_is_on_all_of_them() {
    let (timeline, _) = parse_timeline("[[timeline]]\nat_s = 0\norder = \"jam\"\nuntil_s = 1\n");
    assert_eq!(timeline.entries().len(), 16);
}

#[test]
fn every_problem_of_every_entry_is_named() {
    let text = "\
[[timeline]]
at_s = 60.0
order = \"kill\"
motes = [1, 5]
[[timeline]]
at_s = 2.0
order = \"jam\"
until_s = 2.0
channels = [10]
x_m = 3.0
[[timeline]]
at_s = 2.0
order = \"send\"
motes = 7
destination = 9
payload = \"a\"
payload_hex = \"0\"
[[timeline]]
at_s = 2.0
order = \"kil\"
motes = 1
[[timeline]]
at_s = 2.0
order = \"send\"
motes = 0
destination = 1
payload_hex = \"0g\"
[[timeline]]
order = \"add\"
until_s = 3.0
";
    assert_eq!(
        parse_timeline(text).1,
        [
            "timeline[1].channels[0]: must be a whole number from 11 to 26, got 10 (nearest valid: 11)",
            "timeline[3].order: must be one of \"kill\", \"revive\", \"add\", \"jam\", \"send\", got \"kil\" (nearest \
             valid: \"kill\")",
            "timeline[5].motes: is missing: must be a whole number from 0 to 4294967294, or a list, each entry a whole \
             number from 0 to 4294967294",
            "timeline[5].at_s: is missing: must be a number, from 0 to 1000000000",
            "timeline[5].until_s: does not apply with order = \"add\", only with \"jam\"",
            "timeline[0].at_s: must be less than experiment.duration_s, 60, got 60",
            "timeline[0].motes[1]: must be the number of a mote, 0 to 4, got 5 (nearest valid: 4)",
            "timeline[1].until_s: must be greater than at_s, 2, got 2",
            "timeline[1].x_m: must be set together with radius_m, got 3",
            "timeline[2].destination: must be the number of a mote, 0 to 4, got 9 (nearest valid: 4)",
            "timeline[2]: must have exactly one of the keys payload and payload_hex",
            "timeline[2].motes: must be the number of a mote, 0 to 4, got 7 (nearest valid: 4)",
            "timeline[4].payload_hex: must be hexadecimal digits, two per byte, got \"0g\"",
        ]
    );
}

#[test]
fn something_else_than_entries_is_refused() {
    assert_eq!(
        parse_timeline("timeline = 3").1,
        ["timeline: must be an array of tables ([[...]]), got 3"]
    );
}

#[test]
fn orders_that_the_network_would_not_notice_are_problems_once_for_each_entry() {
    let text = "\
[[timeline]]
at_s = 3.0
order = \"jam\"
until_s = 4.0
[[timeline]]
at_s = 2.0
order = \"kill\"
motes = 1
[[timeline]]
at_s = 1.0
order = \"send\"
motes = [1, 2]
destination = 0
payload = \"a\"
";
    let (timeline, _) = parse_timeline(text);
    let unnoticed = |netsim: &str| {
        let mut problems = Vec::new();
        let netsim = proto::config::parse(netsim).unwrap();
        timeline.check_orders(
            netsim::config::commands(&netsim, netsim::catalogue::Catalogue::built_in()),
            &mut problems,
        );
        problems.iter().map(ToString::to_string).collect::<Vec<_>>()
    };
    assert_eq!(unnoticed("mode = \"6tisch\""), Vec::<String>::new());
    assert_eq!(
        unnoticed(""),
        [
            "timeline[0].order: is not supported with netsim.mode = \"propagation-only\": it has no interference, got \
             \"jam\" (nearest valid: netsim.mode = \"6tisch\")",
            "timeline[2].order: is not supported with netsim.mode = \"propagation-only\": it sends only the robots' \
             payloads, got \"send\" (nearest valid: netsim.mode = \"6tisch\")",
        ]
    );
}

#[test]
fn only_motes_that_are_left_out_can_be_added() {
    let text = "[[timeline]]\nat_s = 3.0\norder = \"add\"\nmotes = [4, 1]\n[[timeline]]\nat_s = 2.0\norder = \"add\"\nmotes = 2\n";
    let (timeline, _) = parse_timeline(text);
    let refused = |netsim: &str| {
        let mut problems = Vec::new();
        let absent = netsim::config::absent(
            &proto::config::parse(netsim).unwrap(),
            netsim::catalogue::Catalogue::built_in(),
        );
        timeline.check_added(&absent, &mut problems);
        problems.iter().map(ToString::to_string).collect::<Vec<_>>()
    };
    assert_eq!(refused("absent = [1, 2, 4]"), Vec::<String>::new());
    let words = "must be motes listed in netsim.absent, because all other motes are present from the beginning";
    assert_eq!(
        refused("absent = [4]"),
        [
            format!("timeline[0].motes: {words}, got 1"),
            format!("timeline[1].motes: {words}, got 2")
        ]
    );
}
