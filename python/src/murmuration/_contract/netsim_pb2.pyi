from murmuration._contract import common_pb2 as _common_pb2
from google.protobuf.internal import containers as _containers
from google.protobuf.internal import enum_type_wrapper as _enum_type_wrapper
from google.protobuf import descriptor as _descriptor
from google.protobuf import message as _message
from typing import ClassVar as _ClassVar, Iterable as _Iterable, Mapping as _Mapping, Optional as _Optional, Union as _Union

DESCRIPTOR: _descriptor.FileDescriptor

class MoteCommandKind(int, metaclass=_enum_type_wrapper.EnumTypeWrapper):
    __slots__ = ()
    MOTE_COMMAND_KIND_UNSPECIFIED: _ClassVar[MoteCommandKind]
    MOTE_COMMAND_KIND_KILL: _ClassVar[MoteCommandKind]
    MOTE_COMMAND_KIND_REVIVE: _ClassVar[MoteCommandKind]
    MOTE_COMMAND_KIND_ADD: _ClassVar[MoteCommandKind]
    MOTE_COMMAND_KIND_JAM: _ClassVar[MoteCommandKind]
    MOTE_COMMAND_KIND_SEND: _ClassVar[MoteCommandKind]

class NetRecord(int, metaclass=_enum_type_wrapper.EnumTypeWrapper):
    __slots__ = ()
    NET_RECORD_UNSPECIFIED: _ClassVar[NetRecord]
    NET_RECORD_PACKETS: _ClassVar[NetRecord]
    NET_RECORD_CAPTURE: _ClassVar[NetRecord]
    NET_RECORD_STATISTICS: _ClassVar[NetRecord]
    NET_RECORD_SCHEDULE: _ClassVar[NetRecord]
    NET_RECORD_HEARD_LINKS: _ClassVar[NetRecord]
    NET_RECORD_FRAMES: _ClassVar[NetRecord]

class FrameOutcome(int, metaclass=_enum_type_wrapper.EnumTypeWrapper):
    __slots__ = ()
    FRAME_OUTCOME_UNSPECIFIED: _ClassVar[FrameOutcome]
    FRAME_OUTCOME_LOST: _ClassVar[FrameOutcome]
    FRAME_OUTCOME_NOT_ACKNOWLEDGED: _ClassVar[FrameOutcome]
    FRAME_OUTCOME_ACKNOWLEDGED: _ClassVar[FrameOutcome]
MOTE_COMMAND_KIND_UNSPECIFIED: MoteCommandKind
MOTE_COMMAND_KIND_KILL: MoteCommandKind
MOTE_COMMAND_KIND_REVIVE: MoteCommandKind
MOTE_COMMAND_KIND_ADD: MoteCommandKind
MOTE_COMMAND_KIND_JAM: MoteCommandKind
MOTE_COMMAND_KIND_SEND: MoteCommandKind
NET_RECORD_UNSPECIFIED: NetRecord
NET_RECORD_PACKETS: NetRecord
NET_RECORD_CAPTURE: NetRecord
NET_RECORD_STATISTICS: NetRecord
NET_RECORD_SCHEDULE: NetRecord
NET_RECORD_HEARD_LINKS: NetRecord
NET_RECORD_FRAMES: NetRecord
FRAME_OUTCOME_UNSPECIFIED: FrameOutcome
FRAME_OUTCOME_LOST: FrameOutcome
FRAME_OUTCOME_NOT_ACKNOWLEDGED: FrameOutcome
FRAME_OUTCOME_ACKNOWLEDGED: FrameOutcome

class PacketKind(_message.Message):
    __slots__ = ("name", "is_application", "created")
    NAME_FIELD_NUMBER: _ClassVar[int]
    IS_APPLICATION_FIELD_NUMBER: _ClassVar[int]
    CREATED_FIELD_NUMBER: _ClassVar[int]
    name: str
    is_application: bool
    created: int
    def __init__(self, name: _Optional[str] = ..., is_application: bool = ..., created: _Optional[int] = ...) -> None: ...

class Packets(_message.Message):
    __slots__ = ("id", "kind", "source", "destination", "created_ns", "ended_ns", "hops", "payload_bytes", "outcome", "kinds", "reasons")
    ID_FIELD_NUMBER: _ClassVar[int]
    KIND_FIELD_NUMBER: _ClassVar[int]
    SOURCE_FIELD_NUMBER: _ClassVar[int]
    DESTINATION_FIELD_NUMBER: _ClassVar[int]
    CREATED_NS_FIELD_NUMBER: _ClassVar[int]
    ENDED_NS_FIELD_NUMBER: _ClassVar[int]
    HOPS_FIELD_NUMBER: _ClassVar[int]
    PAYLOAD_BYTES_FIELD_NUMBER: _ClassVar[int]
    OUTCOME_FIELD_NUMBER: _ClassVar[int]
    KINDS_FIELD_NUMBER: _ClassVar[int]
    REASONS_FIELD_NUMBER: _ClassVar[int]
    id: _containers.RepeatedScalarFieldContainer[int]
    kind: _containers.RepeatedScalarFieldContainer[int]
    source: _containers.RepeatedScalarFieldContainer[int]
    destination: _containers.RepeatedScalarFieldContainer[int]
    created_ns: _containers.RepeatedScalarFieldContainer[int]
    ended_ns: _containers.RepeatedScalarFieldContainer[int]
    hops: _containers.RepeatedScalarFieldContainer[int]
    payload_bytes: _containers.RepeatedScalarFieldContainer[int]
    outcome: _containers.RepeatedScalarFieldContainer[int]
    kinds: _containers.RepeatedCompositeFieldContainer[PacketKind]
    reasons: _containers.RepeatedScalarFieldContainer[str]
    def __init__(self, id: _Optional[_Iterable[int]] = ..., kind: _Optional[_Iterable[int]] = ..., source: _Optional[_Iterable[int]] = ..., destination: _Optional[_Iterable[int]] = ..., created_ns: _Optional[_Iterable[int]] = ..., ended_ns: _Optional[_Iterable[int]] = ..., hops: _Optional[_Iterable[int]] = ..., payload_bytes: _Optional[_Iterable[int]] = ..., outcome: _Optional[_Iterable[int]] = ..., kinds: _Optional[_Iterable[_Union[PacketKind, _Mapping]]] = ..., reasons: _Optional[_Iterable[str]] = ...) -> None: ...

class Frames(_message.Message):
    __slots__ = ("sent_ns", "sender", "destination", "channel", "channel_offset", "kind", "length_bytes", "packet", "attempt", "n_received", "n_missed", "outcome", "kinds")
    SENT_NS_FIELD_NUMBER: _ClassVar[int]
    SENDER_FIELD_NUMBER: _ClassVar[int]
    DESTINATION_FIELD_NUMBER: _ClassVar[int]
    CHANNEL_FIELD_NUMBER: _ClassVar[int]
    CHANNEL_OFFSET_FIELD_NUMBER: _ClassVar[int]
    KIND_FIELD_NUMBER: _ClassVar[int]
    LENGTH_BYTES_FIELD_NUMBER: _ClassVar[int]
    PACKET_FIELD_NUMBER: _ClassVar[int]
    ATTEMPT_FIELD_NUMBER: _ClassVar[int]
    N_RECEIVED_FIELD_NUMBER: _ClassVar[int]
    N_MISSED_FIELD_NUMBER: _ClassVar[int]
    OUTCOME_FIELD_NUMBER: _ClassVar[int]
    KINDS_FIELD_NUMBER: _ClassVar[int]
    sent_ns: _containers.RepeatedScalarFieldContainer[int]
    sender: _containers.RepeatedScalarFieldContainer[int]
    destination: _containers.RepeatedScalarFieldContainer[int]
    channel: _containers.RepeatedScalarFieldContainer[int]
    channel_offset: _containers.RepeatedScalarFieldContainer[int]
    kind: _containers.RepeatedScalarFieldContainer[int]
    length_bytes: _containers.RepeatedScalarFieldContainer[int]
    packet: _containers.RepeatedScalarFieldContainer[int]
    attempt: _containers.RepeatedScalarFieldContainer[int]
    n_received: _containers.RepeatedScalarFieldContainer[int]
    n_missed: _containers.RepeatedScalarFieldContainer[int]
    outcome: _containers.RepeatedScalarFieldContainer[FrameOutcome]
    kinds: _containers.RepeatedScalarFieldContainer[str]
    def __init__(self, sent_ns: _Optional[_Iterable[int]] = ..., sender: _Optional[_Iterable[int]] = ..., destination: _Optional[_Iterable[int]] = ..., channel: _Optional[_Iterable[int]] = ..., channel_offset: _Optional[_Iterable[int]] = ..., kind: _Optional[_Iterable[int]] = ..., length_bytes: _Optional[_Iterable[int]] = ..., packet: _Optional[_Iterable[int]] = ..., attempt: _Optional[_Iterable[int]] = ..., n_received: _Optional[_Iterable[int]] = ..., n_missed: _Optional[_Iterable[int]] = ..., outcome: _Optional[_Iterable[_Union[FrameOutcome, str]]] = ..., kinds: _Optional[_Iterable[str]] = ...) -> None: ...

class Statistic(_message.Message):
    __slots__ = ("name", "unit", "values", "known")
    NAME_FIELD_NUMBER: _ClassVar[int]
    UNIT_FIELD_NUMBER: _ClassVar[int]
    VALUES_FIELD_NUMBER: _ClassVar[int]
    KNOWN_FIELD_NUMBER: _ClassVar[int]
    name: str
    unit: str
    values: _containers.RepeatedScalarFieldContainer[float]
    known: bytes
    def __init__(self, name: _Optional[str] = ..., unit: _Optional[str] = ..., values: _Optional[_Iterable[float]] = ..., known: _Optional[bytes] = ...) -> None: ...

class MoteStatistics(_message.Message):
    __slots__ = ("columns",)
    COLUMNS_FIELD_NUMBER: _ClassVar[int]
    columns: _containers.RepeatedCompositeFieldContainer[Statistic]
    def __init__(self, columns: _Optional[_Iterable[_Union[Statistic, _Mapping]]] = ...) -> None: ...

class Schedule(_message.Message):
    __slots__ = ("mote", "slotframe", "slotframe_slots", "slot", "channel_offset", "options", "neighbour")
    MOTE_FIELD_NUMBER: _ClassVar[int]
    SLOTFRAME_FIELD_NUMBER: _ClassVar[int]
    SLOTFRAME_SLOTS_FIELD_NUMBER: _ClassVar[int]
    SLOT_FIELD_NUMBER: _ClassVar[int]
    CHANNEL_OFFSET_FIELD_NUMBER: _ClassVar[int]
    OPTIONS_FIELD_NUMBER: _ClassVar[int]
    NEIGHBOUR_FIELD_NUMBER: _ClassVar[int]
    mote: _containers.RepeatedScalarFieldContainer[int]
    slotframe: _containers.RepeatedScalarFieldContainer[int]
    slotframe_slots: _containers.RepeatedScalarFieldContainer[int]
    slot: _containers.RepeatedScalarFieldContainer[int]
    channel_offset: _containers.RepeatedScalarFieldContainer[int]
    options: _containers.RepeatedScalarFieldContainer[int]
    neighbour: _containers.RepeatedScalarFieldContainer[int]
    def __init__(self, mote: _Optional[_Iterable[int]] = ..., slotframe: _Optional[_Iterable[int]] = ..., slotframe_slots: _Optional[_Iterable[int]] = ..., slot: _Optional[_Iterable[int]] = ..., channel_offset: _Optional[_Iterable[int]] = ..., options: _Optional[_Iterable[int]] = ..., neighbour: _Optional[_Iterable[int]] = ...) -> None: ...

class HeardLinks(_message.Message):
    __slots__ = ("receiver", "sender", "frames", "rssi_dbm")
    RECEIVER_FIELD_NUMBER: _ClassVar[int]
    SENDER_FIELD_NUMBER: _ClassVar[int]
    FRAMES_FIELD_NUMBER: _ClassVar[int]
    RSSI_DBM_FIELD_NUMBER: _ClassVar[int]
    receiver: _containers.RepeatedScalarFieldContainer[int]
    sender: _containers.RepeatedScalarFieldContainer[int]
    frames: _containers.RepeatedScalarFieldContainer[int]
    rssi_dbm: _containers.RepeatedScalarFieldContainer[float]
    def __init__(self, receiver: _Optional[_Iterable[int]] = ..., sender: _Optional[_Iterable[int]] = ..., frames: _Optional[_Iterable[int]] = ..., rssi_dbm: _Optional[_Iterable[float]] = ...) -> None: ...

class Formation(_message.Message):
    __slots__ = ("formed", "formed_ns", "missing", "reason", "reasons")
    FORMED_FIELD_NUMBER: _ClassVar[int]
    FORMED_NS_FIELD_NUMBER: _ClassVar[int]
    MISSING_FIELD_NUMBER: _ClassVar[int]
    REASON_FIELD_NUMBER: _ClassVar[int]
    REASONS_FIELD_NUMBER: _ClassVar[int]
    formed: bool
    formed_ns: int
    missing: _containers.RepeatedScalarFieldContainer[int]
    reason: _containers.RepeatedScalarFieldContainer[int]
    reasons: _containers.RepeatedScalarFieldContainer[str]
    def __init__(self, formed: bool = ..., formed_ns: _Optional[int] = ..., missing: _Optional[_Iterable[int]] = ..., reason: _Optional[_Iterable[int]] = ..., reasons: _Optional[_Iterable[str]] = ...) -> None: ...

class MoteCommand(_message.Message):
    __slots__ = ("source", "kill", "revive", "add", "jam", "send")
    class Kill(_message.Message):
        __slots__ = ("mote",)
        MOTE_FIELD_NUMBER: _ClassVar[int]
        mote: int
        def __init__(self, mote: _Optional[int] = ...) -> None: ...
    class Revive(_message.Message):
        __slots__ = ("mote",)
        MOTE_FIELD_NUMBER: _ClassVar[int]
        mote: int
        def __init__(self, mote: _Optional[int] = ...) -> None: ...
    class Add(_message.Message):
        __slots__ = ("mote",)
        MOTE_FIELD_NUMBER: _ClassVar[int]
        mote: int
        def __init__(self, mote: _Optional[int] = ...) -> None: ...
    class Jam(_message.Message):
        __slots__ = ("channel", "from_ns", "until_ns", "x_m", "y_m", "radius_m")
        CHANNEL_FIELD_NUMBER: _ClassVar[int]
        FROM_NS_FIELD_NUMBER: _ClassVar[int]
        UNTIL_NS_FIELD_NUMBER: _ClassVar[int]
        X_M_FIELD_NUMBER: _ClassVar[int]
        Y_M_FIELD_NUMBER: _ClassVar[int]
        RADIUS_M_FIELD_NUMBER: _ClassVar[int]
        channel: int
        from_ns: int
        until_ns: int
        x_m: float
        y_m: float
        radius_m: float
        def __init__(self, channel: _Optional[int] = ..., from_ns: _Optional[int] = ..., until_ns: _Optional[int] = ..., x_m: _Optional[float] = ..., y_m: _Optional[float] = ..., radius_m: _Optional[float] = ...) -> None: ...
    class Send(_message.Message):
        __slots__ = ("mote", "destination", "payload")
        MOTE_FIELD_NUMBER: _ClassVar[int]
        DESTINATION_FIELD_NUMBER: _ClassVar[int]
        PAYLOAD_FIELD_NUMBER: _ClassVar[int]
        mote: int
        destination: int
        payload: bytes
        def __init__(self, mote: _Optional[int] = ..., destination: _Optional[int] = ..., payload: _Optional[bytes] = ...) -> None: ...
    SOURCE_FIELD_NUMBER: _ClassVar[int]
    KILL_FIELD_NUMBER: _ClassVar[int]
    REVIVE_FIELD_NUMBER: _ClassVar[int]
    ADD_FIELD_NUMBER: _ClassVar[int]
    JAM_FIELD_NUMBER: _ClassVar[int]
    SEND_FIELD_NUMBER: _ClassVar[int]
    source: str
    kill: MoteCommand.Kill
    revive: MoteCommand.Revive
    add: MoteCommand.Add
    jam: MoteCommand.Jam
    send: MoteCommand.Send
    def __init__(self, source: _Optional[str] = ..., kill: _Optional[_Union[MoteCommand.Kill, _Mapping]] = ..., revive: _Optional[_Union[MoteCommand.Revive, _Mapping]] = ..., add: _Optional[_Union[MoteCommand.Add, _Mapping]] = ..., jam: _Optional[_Union[MoteCommand.Jam, _Mapping]] = ..., send: _Optional[_Union[MoteCommand.Send, _Mapping]] = ...) -> None: ...

class NetSimServiceDescribeRequest(_message.Message):
    __slots__ = ()
    def __init__(self) -> None: ...

class NetSimServiceDescribeResponse(_message.Message):
    __slots__ = ("name", "version", "contract_version", "limits", "session", "snapshots", "commands", "parallel", "stop_at_first_delivery", "columns", "config_schema_json", "records", "full_digest", "reseed")
    NAME_FIELD_NUMBER: _ClassVar[int]
    VERSION_FIELD_NUMBER: _ClassVar[int]
    CONTRACT_VERSION_FIELD_NUMBER: _ClassVar[int]
    LIMITS_FIELD_NUMBER: _ClassVar[int]
    SESSION_FIELD_NUMBER: _ClassVar[int]
    SNAPSHOTS_FIELD_NUMBER: _ClassVar[int]
    COMMANDS_FIELD_NUMBER: _ClassVar[int]
    PARALLEL_FIELD_NUMBER: _ClassVar[int]
    STOP_AT_FIRST_DELIVERY_FIELD_NUMBER: _ClassVar[int]
    COLUMNS_FIELD_NUMBER: _ClassVar[int]
    CONFIG_SCHEMA_JSON_FIELD_NUMBER: _ClassVar[int]
    RECORDS_FIELD_NUMBER: _ClassVar[int]
    FULL_DIGEST_FIELD_NUMBER: _ClassVar[int]
    RESEED_FIELD_NUMBER: _ClassVar[int]
    name: str
    version: str
    contract_version: int
    limits: _common_pb2.Limits
    session: bool
    snapshots: bool
    commands: _containers.RepeatedScalarFieldContainer[MoteCommandKind]
    parallel: bool
    stop_at_first_delivery: bool
    columns: _containers.RepeatedScalarFieldContainer[_common_pb2.DeliveryColumn]
    config_schema_json: str
    records: _containers.RepeatedScalarFieldContainer[NetRecord]
    full_digest: bool
    reseed: bool
    def __init__(self, name: _Optional[str] = ..., version: _Optional[str] = ..., contract_version: _Optional[int] = ..., limits: _Optional[_Union[_common_pb2.Limits, _Mapping]] = ..., session: bool = ..., snapshots: bool = ..., commands: _Optional[_Iterable[_Union[MoteCommandKind, str]]] = ..., parallel: bool = ..., stop_at_first_delivery: bool = ..., columns: _Optional[_Iterable[_Union[_common_pb2.DeliveryColumn, str]]] = ..., config_schema_json: _Optional[str] = ..., records: _Optional[_Iterable[_Union[NetRecord, str]]] = ..., full_digest: bool = ..., reseed: bool = ...) -> None: ...

class NetSimServiceConfigureRequest(_message.Message):
    __slots__ = ("seed", "agent_count", "step_ns", "coupling", "site_toml", "config_toml", "columns", "files", "records", "full_digest")
    SEED_FIELD_NUMBER: _ClassVar[int]
    AGENT_COUNT_FIELD_NUMBER: _ClassVar[int]
    STEP_NS_FIELD_NUMBER: _ClassVar[int]
    COUPLING_FIELD_NUMBER: _ClassVar[int]
    SITE_TOML_FIELD_NUMBER: _ClassVar[int]
    CONFIG_TOML_FIELD_NUMBER: _ClassVar[int]
    COLUMNS_FIELD_NUMBER: _ClassVar[int]
    FILES_FIELD_NUMBER: _ClassVar[int]
    RECORDS_FIELD_NUMBER: _ClassVar[int]
    FULL_DIGEST_FIELD_NUMBER: _ClassVar[int]
    seed: int
    agent_count: int
    step_ns: int
    coupling: _common_pb2.Coupling
    site_toml: str
    config_toml: str
    columns: _containers.RepeatedScalarFieldContainer[_common_pb2.DeliveryColumn]
    files: _containers.RepeatedCompositeFieldContainer[_common_pb2.File]
    records: _containers.RepeatedScalarFieldContainer[NetRecord]
    full_digest: bool
    def __init__(self, seed: _Optional[int] = ..., agent_count: _Optional[int] = ..., step_ns: _Optional[int] = ..., coupling: _Optional[_Union[_common_pb2.Coupling, str]] = ..., site_toml: _Optional[str] = ..., config_toml: _Optional[str] = ..., columns: _Optional[_Iterable[_Union[_common_pb2.DeliveryColumn, str]]] = ..., files: _Optional[_Iterable[_Union[_common_pb2.File, _Mapping]]] = ..., records: _Optional[_Iterable[_Union[NetRecord, str]]] = ..., full_digest: bool = ...) -> None: ...

class NetSimServiceConfigureResponse(_message.Message):
    __slots__ = ("effective_config_toml", "motes", "warnings", "formation", "records", "statistics", "capture_header", "max_payload_bytes")
    EFFECTIVE_CONFIG_TOML_FIELD_NUMBER: _ClassVar[int]
    MOTES_FIELD_NUMBER: _ClassVar[int]
    WARNINGS_FIELD_NUMBER: _ClassVar[int]
    FORMATION_FIELD_NUMBER: _ClassVar[int]
    RECORDS_FIELD_NUMBER: _ClassVar[int]
    STATISTICS_FIELD_NUMBER: _ClassVar[int]
    CAPTURE_HEADER_FIELD_NUMBER: _ClassVar[int]
    MAX_PAYLOAD_BYTES_FIELD_NUMBER: _ClassVar[int]
    effective_config_toml: str
    motes: _common_pb2.MoteStates
    warnings: _containers.RepeatedScalarFieldContainer[str]
    formation: Formation
    records: _containers.RepeatedScalarFieldContainer[NetRecord]
    statistics: MoteStatistics
    capture_header: bytes
    max_payload_bytes: int
    def __init__(self, effective_config_toml: _Optional[str] = ..., motes: _Optional[_Union[_common_pb2.MoteStates, _Mapping]] = ..., warnings: _Optional[_Iterable[str]] = ..., formation: _Optional[_Union[Formation, _Mapping]] = ..., records: _Optional[_Iterable[_Union[NetRecord, str]]] = ..., statistics: _Optional[_Union[MoteStatistics, _Mapping]] = ..., capture_header: _Optional[bytes] = ..., max_payload_bytes: _Optional[int] = ...) -> None: ...

class NetSimServiceStepRequest(_message.Message):
    __slots__ = ("step", "until_ns", "states", "payloads", "moved_obstacles", "commands", "stop_at_first_delivery", "confirmed_digest", "records")
    STEP_FIELD_NUMBER: _ClassVar[int]
    UNTIL_NS_FIELD_NUMBER: _ClassVar[int]
    STATES_FIELD_NUMBER: _ClassVar[int]
    PAYLOADS_FIELD_NUMBER: _ClassVar[int]
    MOVED_OBSTACLES_FIELD_NUMBER: _ClassVar[int]
    COMMANDS_FIELD_NUMBER: _ClassVar[int]
    STOP_AT_FIRST_DELIVERY_FIELD_NUMBER: _ClassVar[int]
    CONFIRMED_DIGEST_FIELD_NUMBER: _ClassVar[int]
    RECORDS_FIELD_NUMBER: _ClassVar[int]
    step: int
    until_ns: int
    states: _common_pb2.AgentStates
    payloads: _common_pb2.Payloads
    moved_obstacles: _containers.RepeatedCompositeFieldContainer[_common_pb2.MovedObstacle]
    commands: _containers.RepeatedCompositeFieldContainer[MoteCommand]
    stop_at_first_delivery: bool
    confirmed_digest: bytes
    records: _containers.RepeatedScalarFieldContainer[NetRecord]
    def __init__(self, step: _Optional[int] = ..., until_ns: _Optional[int] = ..., states: _Optional[_Union[_common_pb2.AgentStates, _Mapping]] = ..., payloads: _Optional[_Union[_common_pb2.Payloads, _Mapping]] = ..., moved_obstacles: _Optional[_Iterable[_Union[_common_pb2.MovedObstacle, _Mapping]]] = ..., commands: _Optional[_Iterable[_Union[MoteCommand, _Mapping]]] = ..., stop_at_first_delivery: bool = ..., confirmed_digest: _Optional[bytes] = ..., records: _Optional[_Iterable[_Union[NetRecord, str]]] = ...) -> None: ...

class NetSimServiceStepResponse(_message.Message):
    __slots__ = ("step", "time_ns", "deliveries", "motes", "commands", "applied_commands", "digest", "formation", "packets", "capture", "statistics", "schedule", "heard_links", "frames")
    STEP_FIELD_NUMBER: _ClassVar[int]
    TIME_NS_FIELD_NUMBER: _ClassVar[int]
    DELIVERIES_FIELD_NUMBER: _ClassVar[int]
    MOTES_FIELD_NUMBER: _ClassVar[int]
    COMMANDS_FIELD_NUMBER: _ClassVar[int]
    APPLIED_COMMANDS_FIELD_NUMBER: _ClassVar[int]
    DIGEST_FIELD_NUMBER: _ClassVar[int]
    FORMATION_FIELD_NUMBER: _ClassVar[int]
    PACKETS_FIELD_NUMBER: _ClassVar[int]
    CAPTURE_FIELD_NUMBER: _ClassVar[int]
    STATISTICS_FIELD_NUMBER: _ClassVar[int]
    SCHEDULE_FIELD_NUMBER: _ClassVar[int]
    HEARD_LINKS_FIELD_NUMBER: _ClassVar[int]
    FRAMES_FIELD_NUMBER: _ClassVar[int]
    step: int
    time_ns: int
    deliveries: _common_pb2.Deliveries
    motes: _common_pb2.MoteStates
    commands: _containers.RepeatedCompositeFieldContainer[_common_pb2.AgentCommand]
    applied_commands: _containers.RepeatedCompositeFieldContainer[MoteCommand]
    digest: bytes
    formation: Formation
    packets: Packets
    capture: bytes
    statistics: MoteStatistics
    schedule: Schedule
    heard_links: HeardLinks
    frames: Frames
    def __init__(self, step: _Optional[int] = ..., time_ns: _Optional[int] = ..., deliveries: _Optional[_Union[_common_pb2.Deliveries, _Mapping]] = ..., motes: _Optional[_Union[_common_pb2.MoteStates, _Mapping]] = ..., commands: _Optional[_Iterable[_Union[_common_pb2.AgentCommand, _Mapping]]] = ..., applied_commands: _Optional[_Iterable[_Union[MoteCommand, _Mapping]]] = ..., digest: _Optional[bytes] = ..., formation: _Optional[_Union[Formation, _Mapping]] = ..., packets: _Optional[_Union[Packets, _Mapping]] = ..., capture: _Optional[bytes] = ..., statistics: _Optional[_Union[MoteStatistics, _Mapping]] = ..., schedule: _Optional[_Union[Schedule, _Mapping]] = ..., heard_links: _Optional[_Union[HeardLinks, _Mapping]] = ..., frames: _Optional[_Union[Frames, _Mapping]] = ...) -> None: ...

class NetSimServiceBarrierRequest(_message.Message):
    __slots__ = ("step", "time_ns")
    STEP_FIELD_NUMBER: _ClassVar[int]
    TIME_NS_FIELD_NUMBER: _ClassVar[int]
    step: int
    time_ns: int
    def __init__(self, step: _Optional[int] = ..., time_ns: _Optional[int] = ...) -> None: ...

class NetSimServiceBarrierResponse(_message.Message):
    __slots__ = ("step", "time_ns", "digest")
    STEP_FIELD_NUMBER: _ClassVar[int]
    TIME_NS_FIELD_NUMBER: _ClassVar[int]
    DIGEST_FIELD_NUMBER: _ClassVar[int]
    step: int
    time_ns: int
    digest: bytes
    def __init__(self, step: _Optional[int] = ..., time_ns: _Optional[int] = ..., digest: _Optional[bytes] = ...) -> None: ...

class NetSimServiceSessionRequest(_message.Message):
    __slots__ = ("step", "barrier")
    STEP_FIELD_NUMBER: _ClassVar[int]
    BARRIER_FIELD_NUMBER: _ClassVar[int]
    step: NetSimServiceStepRequest
    barrier: NetSimServiceBarrierRequest
    def __init__(self, step: _Optional[_Union[NetSimServiceStepRequest, _Mapping]] = ..., barrier: _Optional[_Union[NetSimServiceBarrierRequest, _Mapping]] = ...) -> None: ...

class NetSimServiceSessionResponse(_message.Message):
    __slots__ = ("step", "barrier")
    STEP_FIELD_NUMBER: _ClassVar[int]
    BARRIER_FIELD_NUMBER: _ClassVar[int]
    step: NetSimServiceStepResponse
    barrier: NetSimServiceBarrierResponse
    def __init__(self, step: _Optional[_Union[NetSimServiceStepResponse, _Mapping]] = ..., barrier: _Optional[_Union[NetSimServiceBarrierResponse, _Mapping]] = ...) -> None: ...

class NetSimServiceSnapshotRequest(_message.Message):
    __slots__ = ()
    def __init__(self) -> None: ...

class NetSimServiceSnapshotResponse(_message.Message):
    __slots__ = ("state",)
    STATE_FIELD_NUMBER: _ClassVar[int]
    state: bytes
    def __init__(self, state: _Optional[bytes] = ...) -> None: ...

class NetSimServiceRestoreRequest(_message.Message):
    __slots__ = ("state", "seed")
    STATE_FIELD_NUMBER: _ClassVar[int]
    SEED_FIELD_NUMBER: _ClassVar[int]
    state: bytes
    seed: int
    def __init__(self, state: _Optional[bytes] = ..., seed: _Optional[int] = ...) -> None: ...

class NetSimServiceRestoreResponse(_message.Message):
    __slots__ = ("step", "time_ns")
    STEP_FIELD_NUMBER: _ClassVar[int]
    TIME_NS_FIELD_NUMBER: _ClassVar[int]
    step: int
    time_ns: int
    def __init__(self, step: _Optional[int] = ..., time_ns: _Optional[int] = ...) -> None: ...

class NetSimServiceCommandRequest(_message.Message):
    __slots__ = ("commands",)
    COMMANDS_FIELD_NUMBER: _ClassVar[int]
    commands: _containers.RepeatedCompositeFieldContainer[MoteCommand]
    def __init__(self, commands: _Optional[_Iterable[_Union[MoteCommand, _Mapping]]] = ...) -> None: ...

class NetSimServiceCommandResponse(_message.Message):
    __slots__ = ("applies_at_step",)
    APPLIES_AT_STEP_FIELD_NUMBER: _ClassVar[int]
    applies_at_step: int
    def __init__(self, applies_at_step: _Optional[int] = ...) -> None: ...
