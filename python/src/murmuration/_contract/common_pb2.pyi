from google.protobuf.internal import containers as _containers
from google.protobuf.internal import enum_type_wrapper as _enum_type_wrapper
from google.protobuf import descriptor as _descriptor
from google.protobuf import message as _message
from typing import ClassVar as _ClassVar, Iterable as _Iterable, Mapping as _Mapping, Optional as _Optional, Union as _Union

DESCRIPTOR: _descriptor.FileDescriptor

class Coupling(int, metaclass=_enum_type_wrapper.EnumTypeWrapper):
    __slots__ = ()
    COUPLING_UNSPECIFIED: _ClassVar[Coupling]
    COUPLING_SEQUENTIAL: _ClassVar[Coupling]
    COUPLING_PARALLEL: _ClassVar[Coupling]
    COUPLING_EVENT: _ClassVar[Coupling]

class Medium(int, metaclass=_enum_type_wrapper.EnumTypeWrapper):
    __slots__ = ()
    MEDIUM_UNSPECIFIED: _ClassVar[Medium]
    MEDIUM_RADIO: _ClassVar[Medium]
    MEDIUM_TRUTH: _ClassVar[Medium]
    MEDIUM_SECOND: _ClassVar[Medium]

class DeliveryColumn(int, metaclass=_enum_type_wrapper.EnumTypeWrapper):
    __slots__ = ()
    DELIVERY_COLUMN_UNSPECIFIED: _ClassVar[DeliveryColumn]
    DELIVERY_COLUMN_RECEIVED_NS: _ClassVar[DeliveryColumn]
    DELIVERY_COLUMN_RSSI_DBM: _ClassVar[DeliveryColumn]
    DELIVERY_COLUMN_HOPS: _ClassVar[DeliveryColumn]
    DELIVERY_COLUMN_MEDIUM: _ClassVar[DeliveryColumn]
COUPLING_UNSPECIFIED: Coupling
COUPLING_SEQUENTIAL: Coupling
COUPLING_PARALLEL: Coupling
COUPLING_EVENT: Coupling
MEDIUM_UNSPECIFIED: Medium
MEDIUM_RADIO: Medium
MEDIUM_TRUTH: Medium
MEDIUM_SECOND: Medium
DELIVERY_COLUMN_UNSPECIFIED: DeliveryColumn
DELIVERY_COLUMN_RECEIVED_NS: DeliveryColumn
DELIVERY_COLUMN_RSSI_DBM: DeliveryColumn
DELIVERY_COLUMN_HOPS: DeliveryColumn
DELIVERY_COLUMN_MEDIUM: DeliveryColumn

class Limits(_message.Message):
    __slots__ = ("max_message_bytes", "max_agents")
    MAX_MESSAGE_BYTES_FIELD_NUMBER: _ClassVar[int]
    MAX_AGENTS_FIELD_NUMBER: _ClassVar[int]
    max_message_bytes: int
    max_agents: int
    def __init__(self, max_message_bytes: _Optional[int] = ..., max_agents: _Optional[int] = ...) -> None: ...

class Covariate(_message.Message):
    __slots__ = ("name", "values")
    NAME_FIELD_NUMBER: _ClassVar[int]
    VALUES_FIELD_NUMBER: _ClassVar[int]
    name: str
    values: _containers.RepeatedScalarFieldContainer[float]
    def __init__(self, name: _Optional[str] = ..., values: _Optional[_Iterable[float]] = ...) -> None: ...

class AgentStates(_message.Message):
    __slots__ = ("alive", "x_m", "y_m", "z_m", "vx_mps", "vy_mps", "vz_mps", "heading_rad", "covariates")
    ALIVE_FIELD_NUMBER: _ClassVar[int]
    X_M_FIELD_NUMBER: _ClassVar[int]
    Y_M_FIELD_NUMBER: _ClassVar[int]
    Z_M_FIELD_NUMBER: _ClassVar[int]
    VX_MPS_FIELD_NUMBER: _ClassVar[int]
    VY_MPS_FIELD_NUMBER: _ClassVar[int]
    VZ_MPS_FIELD_NUMBER: _ClassVar[int]
    HEADING_RAD_FIELD_NUMBER: _ClassVar[int]
    COVARIATES_FIELD_NUMBER: _ClassVar[int]
    alive: bytes
    x_m: _containers.RepeatedScalarFieldContainer[float]
    y_m: _containers.RepeatedScalarFieldContainer[float]
    z_m: _containers.RepeatedScalarFieldContainer[float]
    vx_mps: _containers.RepeatedScalarFieldContainer[float]
    vy_mps: _containers.RepeatedScalarFieldContainer[float]
    vz_mps: _containers.RepeatedScalarFieldContainer[float]
    heading_rad: _containers.RepeatedScalarFieldContainer[float]
    covariates: _containers.RepeatedCompositeFieldContainer[Covariate]
    def __init__(self, alive: _Optional[bytes] = ..., x_m: _Optional[_Iterable[float]] = ..., y_m: _Optional[_Iterable[float]] = ..., z_m: _Optional[_Iterable[float]] = ..., vx_mps: _Optional[_Iterable[float]] = ..., vy_mps: _Optional[_Iterable[float]] = ..., vz_mps: _Optional[_Iterable[float]] = ..., heading_rad: _Optional[_Iterable[float]] = ..., covariates: _Optional[_Iterable[_Union[Covariate, _Mapping]]] = ...) -> None: ...

class Payloads(_message.Message):
    __slots__ = ("length_bytes", "data")
    LENGTH_BYTES_FIELD_NUMBER: _ClassVar[int]
    DATA_FIELD_NUMBER: _ClassVar[int]
    length_bytes: _containers.RepeatedScalarFieldContainer[int]
    data: bytes
    def __init__(self, length_bytes: _Optional[_Iterable[int]] = ..., data: _Optional[bytes] = ...) -> None: ...

class Transmissions(_message.Message):
    __slots__ = ("sender", "sent_ns", "end_ns", "payloads", "destination")
    SENDER_FIELD_NUMBER: _ClassVar[int]
    SENT_NS_FIELD_NUMBER: _ClassVar[int]
    END_NS_FIELD_NUMBER: _ClassVar[int]
    PAYLOADS_FIELD_NUMBER: _ClassVar[int]
    DESTINATION_FIELD_NUMBER: _ClassVar[int]
    sender: _containers.RepeatedScalarFieldContainer[int]
    sent_ns: _containers.RepeatedScalarFieldContainer[int]
    end_ns: _containers.RepeatedScalarFieldContainer[int]
    payloads: Payloads
    destination: _containers.RepeatedScalarFieldContainer[int]
    def __init__(self, sender: _Optional[_Iterable[int]] = ..., sent_ns: _Optional[_Iterable[int]] = ..., end_ns: _Optional[_Iterable[int]] = ..., payloads: _Optional[_Union[Payloads, _Mapping]] = ..., destination: _Optional[_Iterable[int]] = ...) -> None: ...

class Deliveries(_message.Message):
    __slots__ = ("transmissions", "heard_end", "heard", "heard_bitmap", "received_ns", "rssi_dbm", "hops", "medium")
    TRANSMISSIONS_FIELD_NUMBER: _ClassVar[int]
    HEARD_END_FIELD_NUMBER: _ClassVar[int]
    HEARD_FIELD_NUMBER: _ClassVar[int]
    HEARD_BITMAP_FIELD_NUMBER: _ClassVar[int]
    RECEIVED_NS_FIELD_NUMBER: _ClassVar[int]
    RSSI_DBM_FIELD_NUMBER: _ClassVar[int]
    HOPS_FIELD_NUMBER: _ClassVar[int]
    MEDIUM_FIELD_NUMBER: _ClassVar[int]
    transmissions: Transmissions
    heard_end: _containers.RepeatedScalarFieldContainer[int]
    heard: _containers.RepeatedScalarFieldContainer[int]
    heard_bitmap: bytes
    received_ns: _containers.RepeatedScalarFieldContainer[int]
    rssi_dbm: _containers.RepeatedScalarFieldContainer[float]
    hops: _containers.RepeatedScalarFieldContainer[int]
    medium: _containers.RepeatedScalarFieldContainer[Medium]
    def __init__(self, transmissions: _Optional[_Union[Transmissions, _Mapping]] = ..., heard_end: _Optional[_Iterable[int]] = ..., heard: _Optional[_Iterable[int]] = ..., heard_bitmap: _Optional[bytes] = ..., received_ns: _Optional[_Iterable[int]] = ..., rssi_dbm: _Optional[_Iterable[float]] = ..., hops: _Optional[_Iterable[int]] = ..., medium: _Optional[_Iterable[_Union[Medium, str]]] = ...) -> None: ...

class MoteStates(_message.Message):
    __slots__ = ("alive", "synced", "joined", "rank", "parent", "queue_length")
    ALIVE_FIELD_NUMBER: _ClassVar[int]
    SYNCED_FIELD_NUMBER: _ClassVar[int]
    JOINED_FIELD_NUMBER: _ClassVar[int]
    RANK_FIELD_NUMBER: _ClassVar[int]
    PARENT_FIELD_NUMBER: _ClassVar[int]
    QUEUE_LENGTH_FIELD_NUMBER: _ClassVar[int]
    alive: bytes
    synced: bytes
    joined: bytes
    rank: _containers.RepeatedScalarFieldContainer[int]
    parent: _containers.RepeatedScalarFieldContainer[int]
    queue_length: _containers.RepeatedScalarFieldContainer[int]
    def __init__(self, alive: _Optional[bytes] = ..., synced: _Optional[bytes] = ..., joined: _Optional[bytes] = ..., rank: _Optional[_Iterable[int]] = ..., parent: _Optional[_Iterable[int]] = ..., queue_length: _Optional[_Iterable[int]] = ...) -> None: ...

class AgentCommand(_message.Message):
    __slots__ = ("agent", "source", "velocity", "waypoint", "release")
    class Velocity(_message.Message):
        __slots__ = ("vx_mps", "vy_mps", "vz_mps")
        VX_MPS_FIELD_NUMBER: _ClassVar[int]
        VY_MPS_FIELD_NUMBER: _ClassVar[int]
        VZ_MPS_FIELD_NUMBER: _ClassVar[int]
        vx_mps: float
        vy_mps: float
        vz_mps: float
        def __init__(self, vx_mps: _Optional[float] = ..., vy_mps: _Optional[float] = ..., vz_mps: _Optional[float] = ...) -> None: ...
    class Waypoint(_message.Message):
        __slots__ = ("x_m", "y_m", "z_m")
        X_M_FIELD_NUMBER: _ClassVar[int]
        Y_M_FIELD_NUMBER: _ClassVar[int]
        Z_M_FIELD_NUMBER: _ClassVar[int]
        x_m: float
        y_m: float
        z_m: float
        def __init__(self, x_m: _Optional[float] = ..., y_m: _Optional[float] = ..., z_m: _Optional[float] = ...) -> None: ...
    class Release(_message.Message):
        __slots__ = ()
        def __init__(self) -> None: ...
    AGENT_FIELD_NUMBER: _ClassVar[int]
    SOURCE_FIELD_NUMBER: _ClassVar[int]
    VELOCITY_FIELD_NUMBER: _ClassVar[int]
    WAYPOINT_FIELD_NUMBER: _ClassVar[int]
    RELEASE_FIELD_NUMBER: _ClassVar[int]
    agent: int
    source: str
    velocity: AgentCommand.Velocity
    waypoint: AgentCommand.Waypoint
    release: AgentCommand.Release
    def __init__(self, agent: _Optional[int] = ..., source: _Optional[str] = ..., velocity: _Optional[_Union[AgentCommand.Velocity, _Mapping]] = ..., waypoint: _Optional[_Union[AgentCommand.Waypoint, _Mapping]] = ..., release: _Optional[_Union[AgentCommand.Release, _Mapping]] = ...) -> None: ...

class AgentMessages(_message.Message):
    __slots__ = ("sender", "destination", "payloads")
    SENDER_FIELD_NUMBER: _ClassVar[int]
    DESTINATION_FIELD_NUMBER: _ClassVar[int]
    PAYLOADS_FIELD_NUMBER: _ClassVar[int]
    sender: _containers.RepeatedScalarFieldContainer[int]
    destination: _containers.RepeatedScalarFieldContainer[int]
    payloads: Payloads
    def __init__(self, sender: _Optional[_Iterable[int]] = ..., destination: _Optional[_Iterable[int]] = ..., payloads: _Optional[_Union[Payloads, _Mapping]] = ...) -> None: ...

class TaskFigure(_message.Message):
    __slots__ = ("name", "value")
    NAME_FIELD_NUMBER: _ClassVar[int]
    VALUE_FIELD_NUMBER: _ClassVar[int]
    name: str
    value: float
    def __init__(self, name: _Optional[str] = ..., value: _Optional[float] = ...) -> None: ...

class MovedObstacle(_message.Message):
    __slots__ = ("name", "x_m", "y_m")
    NAME_FIELD_NUMBER: _ClassVar[int]
    X_M_FIELD_NUMBER: _ClassVar[int]
    Y_M_FIELD_NUMBER: _ClassVar[int]
    name: str
    x_m: float
    y_m: float
    def __init__(self, name: _Optional[str] = ..., x_m: _Optional[float] = ..., y_m: _Optional[float] = ...) -> None: ...

class File(_message.Message):
    __slots__ = ("path", "content")
    PATH_FIELD_NUMBER: _ClassVar[int]
    CONTENT_FIELD_NUMBER: _ClassVar[int]
    path: str
    content: bytes
    def __init__(self, path: _Optional[str] = ..., content: _Optional[bytes] = ...) -> None: ...
