//! The messages of the co-simulation contract, and the border between them and valid values.
//!
//! | module | what |
//! |---|---|
//! | [`v1`] | messages generated from `cosim/v1/*.proto` |
//! | [`convert`] | from messages to values, refusing what is malformed, and back |
//!
//! The services over these messages are in the crate `proto-host`, so that whoever only reads or writes a recording
//! links no server.

pub mod convert;

/// The messages of `cosim/v1`. Their documentation is in the `.proto` files.
#[allow(missing_docs, clippy::all, unreachable_pub, reason = "generated code")]
pub mod v1 {
    include!("../generated/cosim.v1.rs");
}

/// Messages of the robots' service, by their names within it.
pub mod robot_sim {
    pub use crate::v1::robot_sim_service_session_request::Request as SessionCall;
    pub use crate::v1::robot_sim_service_session_response::Response as SessionReply;
    pub use crate::v1::{
        RobotSimServiceBarrierRequest as BarrierRequest,
        RobotSimServiceBarrierResponse as BarrierResponse,
        RobotSimServiceCommandRequest as CommandRequest,
        RobotSimServiceCommandResponse as CommandResponse,
        RobotSimServiceConfigureRequest as ConfigureRequest,
        RobotSimServiceConfigureResponse as ConfigureResponse,
        RobotSimServiceDescribeRequest as DescribeRequest,
        RobotSimServiceDescribeResponse as DescribeResponse,
        RobotSimServicePredictRequest as PredictRequest,
        RobotSimServicePredictResponse as PredictResponse,
        RobotSimServiceRestoreRequest as RestoreRequest,
        RobotSimServiceRestoreResponse as RestoreResponse,
        RobotSimServiceSessionRequest as SessionRequest,
        RobotSimServiceSessionResponse as SessionResponse,
        RobotSimServiceSnapshotRequest as SnapshotRequest,
        RobotSimServiceSnapshotResponse as SnapshotResponse,
        RobotSimServiceStepRequest as StepRequest, RobotSimServiceStepResponse as StepResponse,
    };
}

/// Messages of the network's service, by their names within it.
pub mod net_sim {
    pub use crate::v1::net_sim_service_session_request::Request as SessionCall;
    pub use crate::v1::net_sim_service_session_response::Response as SessionReply;
    pub use crate::v1::{
        NetSimServiceBarrierRequest as BarrierRequest,
        NetSimServiceBarrierResponse as BarrierResponse,
        NetSimServiceCommandRequest as CommandRequest,
        NetSimServiceCommandResponse as CommandResponse,
        NetSimServiceConfigureRequest as ConfigureRequest,
        NetSimServiceConfigureResponse as ConfigureResponse,
        NetSimServiceDescribeRequest as DescribeRequest,
        NetSimServiceDescribeResponse as DescribeResponse,
        NetSimServiceRestoreRequest as RestoreRequest,
        NetSimServiceRestoreResponse as RestoreResponse,
        NetSimServiceSessionRequest as SessionRequest,
        NetSimServiceSessionResponse as SessionResponse,
        NetSimServiceSnapshotRequest as SnapshotRequest,
        NetSimServiceSnapshotResponse as SnapshotResponse, NetSimServiceStepRequest as StepRequest,
        NetSimServiceStepResponse as StepResponse,
    };
}

/// The compiled `.proto` files, for reflection and for self-describing records.
pub const FILE_DESCRIPTOR_SET: &[u8] = include_bytes!("../generated/cosim.v1.bin");

/// Version of the contract that `Describe` states.
pub const CONTRACT_VERSION: u32 = 1;
