//! Conformance vectors of the protocols on whole networks. docs/conformance.md lists all of them, with those that single
//! layers answer.

mod application;
mod bench;
mod blacklist;
mod doc;
mod effects;
mod fragments;
mod join;
mod kernel;
mod mac;
mod mac_time;
mod medium;
mod msf;
mod peers;
mod routing;
mod security;
mod standing;
mod traffic;
