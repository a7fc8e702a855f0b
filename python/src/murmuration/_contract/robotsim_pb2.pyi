from murmuration._contract import common_pb2 as _common_pb2
from google.protobuf.internal import containers as _containers
from google.protobuf.internal import enum_type_wrapper as _enum_type_wrapper
from google.protobuf import descriptor as _descriptor
from google.protobuf import message as _message
from typing import ClassVar as _ClassVar, Iterable as _Iterable, Mapping as _Mapping, Optional as _Optional, Union as _Union

DESCRIPTOR: _descriptor.FileDescriptor

class MotionCommandKind(int, metaclass=_enum_type_wrapper.EnumTypeWrapper):
    __slots__ = ()
    MOTION_COMMAND_KIND_UNSPECIFIED: _ClassVar[MotionCommandKind]
    MOTION_COMMAND_KIND_VELOCITY: _ClassVar[MotionCommandKind]
    MOTION_COMMAND_KIND_SPEED_AND_YAW_RATE: _ClassVar[MotionCommandKind]
    MOTION_COMMAND_KIND_SPEED_AND_STEERING: _ClassVar[MotionCommandKind]
MOTION_COMMAND_KIND_UNSPECIFIED: MotionCommandKind
MOTION_COMMAND_KIND_VELOCITY: MotionCommandKind
MOTION_COMMAND_KIND_SPEED_AND_YAW_RATE: MotionCommandKind
MOTION_COMMAND_KIND_SPEED_AND_STEERING: MotionCommandKind

class RobotSimServiceDescribeRequest(_message.Message):
    __slots__ = ()
    def __init__(self) -> None: ...

class RobotSimServiceDescribeResponse(_message.Message):
    __slots__ = ("name", "version", "contract_version", "limits", "session", "snapshots", "commands", "parallel", "config_schema_json", "hold", "full_digest", "predictions", "reseed")
    NAME_FIELD_NUMBER: _ClassVar[int]
    VERSION_FIELD_NUMBER: _ClassVar[int]
    CONTRACT_VERSION_FIELD_NUMBER: _ClassVar[int]
    LIMITS_FIELD_NUMBER: _ClassVar[int]
    SESSION_FIELD_NUMBER: _ClassVar[int]
    SNAPSHOTS_FIELD_NUMBER: _ClassVar[int]
    COMMANDS_FIELD_NUMBER: _ClassVar[int]
    PARALLEL_FIELD_NUMBER: _ClassVar[int]
    CONFIG_SCHEMA_JSON_FIELD_NUMBER: _ClassVar[int]
    HOLD_FIELD_NUMBER: _ClassVar[int]
    FULL_DIGEST_FIELD_NUMBER: _ClassVar[int]
    PREDICTIONS_FIELD_NUMBER: _ClassVar[int]
    RESEED_FIELD_NUMBER: _ClassVar[int]
    name: str
    version: str
    contract_version: int
    limits: _common_pb2.Limits
    session: bool
    snapshots: bool
    commands: bool
    parallel: bool
    config_schema_json: str
    hold: bool
    full_digest: bool
    predictions: bool
    reseed: bool
    def __init__(self, name: _Optional[str] = ..., version: _Optional[str] = ..., contract_version: _Optional[int] = ..., limits: _Optional[_Union[_common_pb2.Limits, _Mapping]] = ..., session: bool = ..., snapshots: bool = ..., commands: bool = ..., parallel: bool = ..., config_schema_json: _Optional[str] = ..., hold: bool = ..., full_digest: bool = ..., predictions: bool = ..., reseed: bool = ...) -> None: ...

class RobotSimServiceConfigureRequest(_message.Message):
    __slots__ = ("seed", "agent_count", "step_ns", "coupling", "site_toml", "config_toml", "files", "full_digest")
    SEED_FIELD_NUMBER: _ClassVar[int]
    AGENT_COUNT_FIELD_NUMBER: _ClassVar[int]
    STEP_NS_FIELD_NUMBER: _ClassVar[int]
    COUPLING_FIELD_NUMBER: _ClassVar[int]
    SITE_TOML_FIELD_NUMBER: _ClassVar[int]
    CONFIG_TOML_FIELD_NUMBER: _ClassVar[int]
    FILES_FIELD_NUMBER: _ClassVar[int]
    FULL_DIGEST_FIELD_NUMBER: _ClassVar[int]
    seed: int
    agent_count: int
    step_ns: int
    coupling: _common_pb2.Coupling
    site_toml: str
    config_toml: str
    files: _containers.RepeatedCompositeFieldContainer[_common_pb2.File]
    full_digest: bool
    def __init__(self, seed: _Optional[int] = ..., agent_count: _Optional[int] = ..., step_ns: _Optional[int] = ..., coupling: _Optional[_Union[_common_pb2.Coupling, str]] = ..., site_toml: _Optional[str] = ..., config_toml: _Optional[str] = ..., files: _Optional[_Iterable[_Union[_common_pb2.File, _Mapping]]] = ..., full_digest: bool = ...) -> None: ...

class RobotSimServiceConfigureResponse(_message.Message):
    __slots__ = ("effective_config_toml", "states", "payloads", "columns", "messages")
    EFFECTIVE_CONFIG_TOML_FIELD_NUMBER: _ClassVar[int]
    STATES_FIELD_NUMBER: _ClassVar[int]
    PAYLOADS_FIELD_NUMBER: _ClassVar[int]
    COLUMNS_FIELD_NUMBER: _ClassVar[int]
    MESSAGES_FIELD_NUMBER: _ClassVar[int]
    effective_config_toml: str
    states: _common_pb2.AgentStates
    payloads: _common_pb2.Payloads
    columns: _containers.RepeatedScalarFieldContainer[_common_pb2.DeliveryColumn]
    messages: bool
    def __init__(self, effective_config_toml: _Optional[str] = ..., states: _Optional[_Union[_common_pb2.AgentStates, _Mapping]] = ..., payloads: _Optional[_Union[_common_pb2.Payloads, _Mapping]] = ..., columns: _Optional[_Iterable[_Union[_common_pb2.DeliveryColumn, str]]] = ..., messages: bool = ...) -> None: ...

class RobotSimServiceStepRequest(_message.Message):
    __slots__ = ("step", "until_ns", "deliveries", "motes", "commands", "confirmed_digest", "hold")
    STEP_FIELD_NUMBER: _ClassVar[int]
    UNTIL_NS_FIELD_NUMBER: _ClassVar[int]
    DELIVERIES_FIELD_NUMBER: _ClassVar[int]
    MOTES_FIELD_NUMBER: _ClassVar[int]
    COMMANDS_FIELD_NUMBER: _ClassVar[int]
    CONFIRMED_DIGEST_FIELD_NUMBER: _ClassVar[int]
    HOLD_FIELD_NUMBER: _ClassVar[int]
    step: int
    until_ns: int
    deliveries: _common_pb2.Deliveries
    motes: _common_pb2.MoteStates
    commands: _containers.RepeatedCompositeFieldContainer[_common_pb2.AgentCommand]
    confirmed_digest: bytes
    hold: bool
    def __init__(self, step: _Optional[int] = ..., until_ns: _Optional[int] = ..., deliveries: _Optional[_Union[_common_pb2.Deliveries, _Mapping]] = ..., motes: _Optional[_Union[_common_pb2.MoteStates, _Mapping]] = ..., commands: _Optional[_Iterable[_Union[_common_pb2.AgentCommand, _Mapping]]] = ..., confirmed_digest: _Optional[bytes] = ..., hold: bool = ...) -> None: ...

class RobotSimServiceStepResponse(_message.Message):
    __slots__ = ("step", "time_ns", "states", "payloads", "moved_obstacles", "commands", "applied_commands", "task_complete", "digest", "held", "messages", "figures")
    STEP_FIELD_NUMBER: _ClassVar[int]
    TIME_NS_FIELD_NUMBER: _ClassVar[int]
    STATES_FIELD_NUMBER: _ClassVar[int]
    PAYLOADS_FIELD_NUMBER: _ClassVar[int]
    MOVED_OBSTACLES_FIELD_NUMBER: _ClassVar[int]
    COMMANDS_FIELD_NUMBER: _ClassVar[int]
    APPLIED_COMMANDS_FIELD_NUMBER: _ClassVar[int]
    TASK_COMPLETE_FIELD_NUMBER: _ClassVar[int]
    DIGEST_FIELD_NUMBER: _ClassVar[int]
    HELD_FIELD_NUMBER: _ClassVar[int]
    MESSAGES_FIELD_NUMBER: _ClassVar[int]
    FIGURES_FIELD_NUMBER: _ClassVar[int]
    step: int
    time_ns: int
    states: _common_pb2.AgentStates
    payloads: _common_pb2.Payloads
    moved_obstacles: _containers.RepeatedCompositeFieldContainer[_common_pb2.MovedObstacle]
    commands: _containers.RepeatedCompositeFieldContainer[_common_pb2.AgentCommand]
    applied_commands: _containers.RepeatedCompositeFieldContainer[_common_pb2.AgentCommand]
    task_complete: bool
    digest: bytes
    held: bool
    messages: _common_pb2.AgentMessages
    figures: _containers.RepeatedCompositeFieldContainer[_common_pb2.TaskFigure]
    def __init__(self, step: _Optional[int] = ..., time_ns: _Optional[int] = ..., states: _Optional[_Union[_common_pb2.AgentStates, _Mapping]] = ..., payloads: _Optional[_Union[_common_pb2.Payloads, _Mapping]] = ..., moved_obstacles: _Optional[_Iterable[_Union[_common_pb2.MovedObstacle, _Mapping]]] = ..., commands: _Optional[_Iterable[_Union[_common_pb2.AgentCommand, _Mapping]]] = ..., applied_commands: _Optional[_Iterable[_Union[_common_pb2.AgentCommand, _Mapping]]] = ..., task_complete: bool = ..., digest: _Optional[bytes] = ..., held: bool = ..., messages: _Optional[_Union[_common_pb2.AgentMessages, _Mapping]] = ..., figures: _Optional[_Iterable[_Union[_common_pb2.TaskFigure, _Mapping]]] = ...) -> None: ...

class RobotSimServiceBarrierRequest(_message.Message):
    __slots__ = ("step", "time_ns")
    STEP_FIELD_NUMBER: _ClassVar[int]
    TIME_NS_FIELD_NUMBER: _ClassVar[int]
    step: int
    time_ns: int
    def __init__(self, step: _Optional[int] = ..., time_ns: _Optional[int] = ...) -> None: ...

class RobotSimServiceBarrierResponse(_message.Message):
    __slots__ = ("step", "time_ns", "digest")
    STEP_FIELD_NUMBER: _ClassVar[int]
    TIME_NS_FIELD_NUMBER: _ClassVar[int]
    DIGEST_FIELD_NUMBER: _ClassVar[int]
    step: int
    time_ns: int
    digest: bytes
    def __init__(self, step: _Optional[int] = ..., time_ns: _Optional[int] = ..., digest: _Optional[bytes] = ...) -> None: ...

class RobotSimServiceSessionRequest(_message.Message):
    __slots__ = ("step", "barrier")
    STEP_FIELD_NUMBER: _ClassVar[int]
    BARRIER_FIELD_NUMBER: _ClassVar[int]
    step: RobotSimServiceStepRequest
    barrier: RobotSimServiceBarrierRequest
    def __init__(self, step: _Optional[_Union[RobotSimServiceStepRequest, _Mapping]] = ..., barrier: _Optional[_Union[RobotSimServiceBarrierRequest, _Mapping]] = ...) -> None: ...

class RobotSimServiceSessionResponse(_message.Message):
    __slots__ = ("step", "barrier")
    STEP_FIELD_NUMBER: _ClassVar[int]
    BARRIER_FIELD_NUMBER: _ClassVar[int]
    step: RobotSimServiceStepResponse
    barrier: RobotSimServiceBarrierResponse
    def __init__(self, step: _Optional[_Union[RobotSimServiceStepResponse, _Mapping]] = ..., barrier: _Optional[_Union[RobotSimServiceBarrierResponse, _Mapping]] = ...) -> None: ...

class RobotSimServiceSnapshotRequest(_message.Message):
    __slots__ = ()
    def __init__(self) -> None: ...

class RobotSimServiceSnapshotResponse(_message.Message):
    __slots__ = ("state",)
    STATE_FIELD_NUMBER: _ClassVar[int]
    state: bytes
    def __init__(self, state: _Optional[bytes] = ...) -> None: ...

class RobotSimServiceRestoreRequest(_message.Message):
    __slots__ = ("state", "seed")
    STATE_FIELD_NUMBER: _ClassVar[int]
    SEED_FIELD_NUMBER: _ClassVar[int]
    state: bytes
    seed: int
    def __init__(self, state: _Optional[bytes] = ..., seed: _Optional[int] = ...) -> None: ...

class RobotSimServiceRestoreResponse(_message.Message):
    __slots__ = ("step", "time_ns")
    STEP_FIELD_NUMBER: _ClassVar[int]
    TIME_NS_FIELD_NUMBER: _ClassVar[int]
    step: int
    time_ns: int
    def __init__(self, step: _Optional[int] = ..., time_ns: _Optional[int] = ...) -> None: ...

class RobotSimServiceCommandRequest(_message.Message):
    __slots__ = ("commands",)
    COMMANDS_FIELD_NUMBER: _ClassVar[int]
    commands: _containers.RepeatedCompositeFieldContainer[_common_pb2.AgentCommand]
    def __init__(self, commands: _Optional[_Iterable[_Union[_common_pb2.AgentCommand, _Mapping]]] = ...) -> None: ...

class RobotSimServiceCommandResponse(_message.Message):
    __slots__ = ("applies_at_step",)
    APPLIES_AT_STEP_FIELD_NUMBER: _ClassVar[int]
    applies_at_step: int
    def __init__(self, applies_at_step: _Optional[int] = ...) -> None: ...

class RobotSimServicePredictRequest(_message.Message):
    __slots__ = ("site_toml", "config_toml", "command_kind", "windows")
    SITE_TOML_FIELD_NUMBER: _ClassVar[int]
    CONFIG_TOML_FIELD_NUMBER: _ClassVar[int]
    COMMAND_KIND_FIELD_NUMBER: _ClassVar[int]
    WINDOWS_FIELD_NUMBER: _ClassVar[int]
    site_toml: str
    config_toml: str
    command_kind: MotionCommandKind
    windows: _containers.RepeatedCompositeFieldContainer[PredictionWindow]
    def __init__(self, site_toml: _Optional[str] = ..., config_toml: _Optional[str] = ..., command_kind: _Optional[_Union[MotionCommandKind, str]] = ..., windows: _Optional[_Iterable[_Union[PredictionWindow, _Mapping]]] = ...) -> None: ...

class PredictionWindow(_message.Message):
    __slots__ = ("agent", "start_ns", "x_m", "y_m", "z_m", "heading_rad", "velocity", "duration_ns", "command_first", "command_second", "command_third")
    AGENT_FIELD_NUMBER: _ClassVar[int]
    START_NS_FIELD_NUMBER: _ClassVar[int]
    X_M_FIELD_NUMBER: _ClassVar[int]
    Y_M_FIELD_NUMBER: _ClassVar[int]
    Z_M_FIELD_NUMBER: _ClassVar[int]
    HEADING_RAD_FIELD_NUMBER: _ClassVar[int]
    VELOCITY_FIELD_NUMBER: _ClassVar[int]
    DURATION_NS_FIELD_NUMBER: _ClassVar[int]
    COMMAND_FIRST_FIELD_NUMBER: _ClassVar[int]
    COMMAND_SECOND_FIELD_NUMBER: _ClassVar[int]
    COMMAND_THIRD_FIELD_NUMBER: _ClassVar[int]
    agent: int
    start_ns: int
    x_m: float
    y_m: float
    z_m: float
    heading_rad: float
    velocity: PredictionVelocity
    duration_ns: _containers.RepeatedScalarFieldContainer[int]
    command_first: _containers.RepeatedScalarFieldContainer[float]
    command_second: _containers.RepeatedScalarFieldContainer[float]
    command_third: _containers.RepeatedScalarFieldContainer[float]
    def __init__(self, agent: _Optional[int] = ..., start_ns: _Optional[int] = ..., x_m: _Optional[float] = ..., y_m: _Optional[float] = ..., z_m: _Optional[float] = ..., heading_rad: _Optional[float] = ..., velocity: _Optional[_Union[PredictionVelocity, _Mapping]] = ..., duration_ns: _Optional[_Iterable[int]] = ..., command_first: _Optional[_Iterable[float]] = ..., command_second: _Optional[_Iterable[float]] = ..., command_third: _Optional[_Iterable[float]] = ...) -> None: ...

class PredictionVelocity(_message.Message):
    __slots__ = ("vx_mps", "vy_mps", "vz_mps")
    VX_MPS_FIELD_NUMBER: _ClassVar[int]
    VY_MPS_FIELD_NUMBER: _ClassVar[int]
    VZ_MPS_FIELD_NUMBER: _ClassVar[int]
    vx_mps: float
    vy_mps: float
    vz_mps: float
    def __init__(self, vx_mps: _Optional[float] = ..., vy_mps: _Optional[float] = ..., vz_mps: _Optional[float] = ...) -> None: ...

class RobotSimServicePredictResponse(_message.Message):
    __slots__ = ("windows",)
    WINDOWS_FIELD_NUMBER: _ClassVar[int]
    windows: _containers.RepeatedCompositeFieldContainer[PredictedWindow]
    def __init__(self, windows: _Optional[_Iterable[_Union[PredictedWindow, _Mapping]]] = ...) -> None: ...

class PredictedWindow(_message.Message):
    __slots__ = ("agent", "x_m", "y_m", "z_m", "heading_rad")
    AGENT_FIELD_NUMBER: _ClassVar[int]
    X_M_FIELD_NUMBER: _ClassVar[int]
    Y_M_FIELD_NUMBER: _ClassVar[int]
    Z_M_FIELD_NUMBER: _ClassVar[int]
    HEADING_RAD_FIELD_NUMBER: _ClassVar[int]
    agent: int
    x_m: _containers.RepeatedScalarFieldContainer[float]
    y_m: _containers.RepeatedScalarFieldContainer[float]
    z_m: _containers.RepeatedScalarFieldContainer[float]
    heading_rad: _containers.RepeatedScalarFieldContainer[float]
    def __init__(self, agent: _Optional[int] = ..., x_m: _Optional[_Iterable[float]] = ..., y_m: _Optional[_Iterable[float]] = ..., z_m: _Optional[_Iterable[float]] = ..., heading_rad: _Optional[_Iterable[float]] = ...) -> None: ...
