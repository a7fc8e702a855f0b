"""ULog files for the tests, written byte by byte as PX4's specification of the format says."""

import struct
from dataclasses import dataclass, field

# Fields of the messages by the names of PX4 1.14; real messages have more. Padding at the end is not written.
POSITION = "uint64_t timestamp;float x;float y;float z;float[2] delta_xy;float delta_z;float heading;bool xy_valid;bool z_valid;uint8_t xy_reset_counter;uint8_t z_reset_counter;"
SETPOINT = "uint64_t timestamp;float x;float y;float z;float vx;float vy;float vz;float[3] acceleration;"
TRAJECTORY = "uint64_t timestamp;float[3] position;float[3] velocity;float[3] acceleration;"
ATTITUDE = "uint64_t timestamp;float[4] q_d;float[3] thrust_body;"
GPS = "uint64_t timestamp;uint64_t time_utc_usec;int32_t timestamp_time_relative;uint8_t[4] _padding0;"
LANDED = "uint64_t timestamp;bool landed;bool ground_contact;uint8_t[6] _padding0;"
FORMATS = {
    "vehicle_local_position": POSITION,
    "vehicle_local_position_setpoint": SETPOINT,
    "trajectory_setpoint": TRAJECTORY,
    "vehicle_attitude_setpoint": ATTITUDE,
    "vehicle_gps_position": GPS,
    "vehicle_land_detected": LANDED,
    "cpuload": "uint64_t timestamp;float load;",
}
CODES = {"uint64_t": "Q", "int32_t": "i", "float": "f", "bool": "?", "uint8_t": "B"}


def message(kind, payload):
    """A message: its size without this head, its kind, and the payload."""
    return struct.pack("<HB", len(payload), ord(kind)) + payload


def key_value(declared, value):
    return struct.pack("<B", len(declared)) + declared.encode() + value


@dataclass
class ULogWriter:
    """Messages of a log; `write` sorts them by time."""

    uuid: str = "0001"
    system: int = 1
    formats: dict = field(default_factory=lambda: dict(FORMATS))
    rows: list = field(default_factory=list)
    dropouts_ms: list = field(default_factory=list)

    def add(self, topic, time_s, *values):
        """A message of a topic: the values of its fields after the time, arrays flat, without padding. `topic#1` is its second instance."""
        self.rows.append((round(time_s * 1e6), topic, values))

    def add_position(self, time_s, north, east, down, yaw=0.0, *, valid=(True, True), resets=(0, 0), delta=(0.0, 0.0, 0.0)):
        self.add("vehicle_local_position", time_s, north, east, down, *delta, yaw, *valid, *resets)

    def add_setpoint(self, time_s, velocity, acceleration=(0.0, 0.0, 0.0)):
        self.add("vehicle_local_position_setpoint", time_s, 0.0, 0.0, 0.0, *velocity, *acceleration)

    def write(self, path):
        """Writes the file and returns its path."""
        names = sorted({topic for _, topic, _ in self.rows})
        # The head: magic bytes, version 1, the time at which the log starts.
        data = b"ULog\x01\x12\x35\x01" + struct.pack("<Q", min((time_us for time_us, _, _ in self.rows), default=0))
        data += message("B", bytes(40))
        for name, fields in self.formats.items():
            data += message("F", f"{name}:{fields}".encode())
        data += message("I", key_value(f"char[{len(self.uuid)}] sys_uuid", self.uuid.encode()))
        data += message("P", key_value("int32_t MAV_SYS_ID", struct.pack("<i", self.system)))
        for number, name in enumerate(names):
            base, _, instance = name.partition("#")
            data += message("A", struct.pack("<BH", int(instance or 0), number) + base.encode())
        for duration_ms in self.dropouts_ms:
            data += message("O", struct.pack("<H", duration_ms))
        for time_us, topic, values in sorted(self.rows, key=lambda row: row[0]):
            codes = "".join(code(one) for one in self.formats[topic.partition("#")[0]].split(";") if one and "_padding" not in one)
            data += message("D", struct.pack(f"<H{codes}", names.index(topic), time_us, *values))
        path.write_bytes(data)
        return path


def code(declared):
    """How `struct` names a field, such as `float[3] acceleration`."""
    kind, _, length = declared.split()[0].partition("[")
    return CODES[kind] * int(length.rstrip("]") or 1)
