//! What a mote makes of each return code: RFC 9033, § 12.

use super::*;
use crate::wire::sixp::{AnswerContent, SixpAnswer, SixpRepr};

/// Two motes; mote 1 has a cell to the root and has asked for another, which is answered with a code.
fn answered(code: ReturnCode) -> Network {
    let mut network = Network::new(2, MsfConfig::default());
    network.set_parent(1, Some(0));
    network.run_until(|network| network.is_ready(1) && network.is_quiet());
    network.mute = Some(0);
    network.motes[1].msf.missing.tx = 1;
    network.tell(1, |msf, cx| msf.drive(cx));
    let (root, now) = (network.address(0), network.now());
    let seqnum = network.motes[1].sixtop.seqnum(root);
    let body = SixpBody::Response(SixpAnswer { code, content: AnswerContent::Nothing });
    let message = SixpRepr { version: 0, sfid: SFID, seqnum, body };
    network.motes[1].sixtop.handle_message(root, &message, now);
    network.tell(1, |_, _| ());
    network
}

fn tx_cells(network: &Network) -> u16 {
    negotiated(network, 1, 0).0
}

#[test]
fn rfc9033_12_quarantine_clears_and_leaves_the_neighbour_alone_for_five_minutes() {
    for code in
        [ReturnCode::Error, ReturnCode::Reset, ReturnCode::ErrorVersion, ReturnCode::ErrorSfid]
    {
        let mut network = answered(code);
        let root = network.address(0);
        assert_eq!(tx_cells(&network), 0);
        assert_eq!(requests(&network, 1, "CLEAR"), 1);
        assert_eq!(network.motes[1].unusable, [root]);
        assert!(network.motes[1].msf.is_quarantined(root));
        network.mute = None;
        let before = requests(&network, 1, "ADD");
        network.run(29_900);
        assert_eq!(requests(&network, 1, "ADD"), before);
        network.run(200);
        assert!(!network.motes[1].msf.is_quarantined(root));
        assert_eq!(requests(&network, 1, "ADD"), before + 1, "routing has kept it");
    }
}

#[test]
fn rfc9033_12_clear_removes_all_cells_and_they_are_built_again() {
    for code in [ReturnCode::ErrorSeqnum, ReturnCode::ErrorCellList] {
        let mut network = answered(code);
        assert_eq!(tx_cells(&network), 0);
        assert_eq!(requests(&network, 1, "CLEAR"), 1);
        assert_eq!(network.motes[1].unusable, []);
        network.mute = None;
        network.run_until(|network| network.is_quiet());
        assert_eq!(tx_cells(&network), 2, "the one it had and the one it had asked for");
        network.assert_agreement();
    }
}

#[test]
fn rfc9033_12_waitretry_repeats_the_transaction_after_30_to_60_s() {
    for code in [ReturnCode::ErrorBusy, ReturnCode::ErrorLocked] {
        let mut network = answered(code);
        network.mute = None;
        assert_eq!(tx_cells(&network), 1);
        let before = requests(&network, 1, "ADD");
        network.run(2_999);
        assert_eq!(requests(&network, 1, "ADD"), before);
        network.run(3_002);
        assert_eq!(requests(&network, 1, "ADD"), before + 1);
    }
}

#[test]
fn requests_of_a_neighbour_in_quarantine_are_not_answered() {
    let mut network = answered(ReturnCode::Error);
    network.mute = None;
    network.run(10 * 101);
    let before = network.last_code(1);
    network.ask(
        0,
        1,
        SixpRequest::Count { metadata: 0, options: crate::wire::sixp::CellOptions(0) },
    );
    assert_eq!(network.last_code(1), before);
    assert!(!network.motes[1].sixtop.is_busy(network.address(0)));
}

#[test]
fn a_responder_refuses_cells_that_are_not_there_and_what_msf_does_not_use() {
    let mut network = Network::new(2, MsfConfig::default());
    network.set_parent(1, Some(0));
    network.run_until(|network| network.is_ready(1) && network.is_quiet());
    let options = crate::wire::sixp::CellOptions(1);
    let nowhere = vec![SixpCell { slot: 99, channel: 15 }];
    let body = |cells| crate::wire::sixp::CellRequest { metadata: 0, options, num_cells: 1, cells };
    for (what, code) in [
        (SixpRequest::Delete(body(nowhere.clone())), ReturnCode::ErrorCellList),
        (SixpRequest::Add(body(vec![])), ReturnCode::Error),
        (SixpRequest::Signal { metadata: 0, payload: vec![1] }, ReturnCode::Error),
        (SixpRequest::Count { metadata: 0, options }, ReturnCode::Success),
        (
            SixpRequest::List { metadata: 0, options, offset: 0, max_num_cells: 9 },
            ReturnCode::EndOfList,
        ),
        (SixpRequest::Add(body(vec![SixpCell { slot: 0, channel: 0 }])), ReturnCode::Success),
    ] {
        let before = negotiated(&network, 0, 1);
        network.ask(1, 0, what.clone());
        assert_eq!(network.last_code(0), Some(code), "{what:?}");
        network.run_until(|network| network.is_quiet());
        assert_eq!(negotiated(&network, 0, 1), before);
    }
}

#[test]
fn keys_are_checked_against_each_other() {
    let (config, problems, _) = crate::sf::testing::read(
        "kind = \"msf\"\nlim_numcellsused_low = 80\nwait_min_s = 90\nmax_num_cells = 50\n",
        2,
    );
    assert!(config.is_none());
    assert_eq!(problems.len(), 3, "{problems:?}");
    let config = crate::sf::testing::built("kind = \"msf\"\n", 2);
    assert_eq!(config.as_kind(), Some(&MsfConfig::default()));
}
