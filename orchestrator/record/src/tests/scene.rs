use super::*;
use crate::scene::foxglove;
use mcap::MessageStream;
use prost::Message as _;

/// The messages of a topic, with their times (ns).
fn messages(content: &[u8], topic: &str) -> Vec<(u64, Vec<u8>)> {
    let all = MessageStream::new(content).unwrap().map(Result::unwrap);
    let of_topic = all.filter(|message| message.channel.topic == topic);
    of_topic.map(|message| (message.log_time, message.data.to_vec())).collect()
}

fn scene(header: RunHeader) -> Vec<u8> {
    let out = tempfile::tempdir().unwrap();
    fs::read(finished(out.path(), header).dir.join("scene.mcap")).unwrap()
}

#[test]
fn robots_are_where_they_were_and_face_where_they_go() {
    let content = scene(header("run"));
    let robots = messages(&content, "/robots");
    assert_eq!(robots.len() as u64, STEPS + 1);
    let (time_ns, last) = &robots[STEPS as usize];
    assert_eq!(*time_ns, STEPS * STEP_NS);
    let last = foxglove::PosesInFrame::decode(&last[..]).unwrap();
    assert_eq!((last.frame_id.as_str(), last.timestamp.unwrap().nanos), ("world", 200_000_000));
    // Of seven one does not exist.
    let x_m: Vec<f64> = last.poses.iter().map(|pose| pose.position.unwrap().x).collect();
    assert_eq!(x_m, states(STEPS).x_m[..6]);
    let transforms = messages(&content, "/tf");
    let transforms = foxglove::FrameTransforms::decode(&transforms[3].1[..]).unwrap().transforms;
    assert_eq!((transforms.len(), transforms[5].child_frame_id.as_str()), (6, "robot_5"));
    assert_eq!(transforms[5].translation.unwrap().x, states(3).x_m[5]);
}

#[test]
fn two_that_hear_each_other_are_joined_by_one_line_of_the_stronger_signal() {
    let content = scene(header("run"));
    let links = messages(&content, "/links");
    assert_eq!(links.len() as u64, STEPS);
    let update = foxglove::SceneUpdate::decode(&links[0].1[..]).unwrap();
    let lines = &update.entities[0].lines;
    // Six on a line hear those up to 2 m away: five pairs of neighbours, and four of the next but one.
    let pairs: usize = lines.iter().map(|line| line.indices.len() / 2).sum();
    assert_eq!(pairs, 9);
    for line in lines {
        assert_eq!(line.points.len(), N);
        let far = line.indices.chunks(2).all(|pair| pair[0] < pair[1] && pair[1] <= pair[0] + 2);
        assert!(far, "{:?}", line.indices);
    }
    // Signals fall by 1 dB from one delivery to the next, in the order of receivers: of the 18 the first eleven are stronger than
    // -70 dBm, and join the first four robots among each other and the last of them to two more.
    let strong = lines.iter().find(|line| line.color.unwrap().b == 0.7).unwrap();
    let expected: std::collections::BTreeSet<[u32; 2]> = {
        let mut strongest = std::collections::BTreeMap::new();
        let deliveries = deliveries(1);
        let mut number = 0;
        for receiver in 0..N as u32 {
            for sender in deliveries.heard_by(receiver as usize) {
                let (pair, dbm) = (
                    [receiver.min(sender as u32), receiver.max(sender as u32)],
                    deliveries.rssi_dbm[number],
                );
                let best = strongest.entry(pair).or_insert(dbm);
                *best = dbm.max(*best);
                number += 1;
            }
        }
        strongest.into_iter().filter(|(_, dbm)| -70.0 <= *dbm).map(|(pair, _)| pair).collect()
    };
    let found = strong.indices.chunks(2).map(|pair| [pair[0], pair[1]]).collect();
    assert_eq!(expected, found);
}

#[test]
fn the_place_is_drawn_once_and_metrics_are_plain_numbers() {
    let content = scene(header("run"));
    let site = messages(&content, "/site");
    assert_eq!(site.len(), 1);
    let update = foxglove::SceneUpdate::decode(&site[0].1[..]).unwrap();
    let walls = update.entities.iter().find(|entity| entity.id == "walls").unwrap();
    assert_eq!(walls.cubes[0].size.unwrap().x, 3.0);
    let metrics = messages(&content, "/metrics");
    let last: Value = serde_json::from_slice(&metrics[STEPS as usize - 1].1).unwrap();
    assert_eq!(
        (&last["n_alive"], &last["n_sent"], &last["n_deliveries"]),
        (&json!(6), &json!(6), &json!(18))
    );
    assert_eq!((&last["mean_neighbours"], &last["n_isolated"]), (&json!(3.0), &json!(0)));
}

#[test]
fn pictures_may_be_fewer_than_steps() {
    let mut header = header("run");
    header.output.scene_every_s = Some(proto::types::seconds(5 * STEP_NS));
    let content = scene(header);
    // At the beginning, after 0.5 s and after 1 s of 1.2 s.
    let times: Vec<u64> = messages(&content, "/robots").iter().map(|(time, _)| *time).collect();
    assert_eq!(times, [0, 5 * STEP_NS, 10 * STEP_NS]);
    assert_eq!(messages(&content, "/metrics").len(), 2);
}
