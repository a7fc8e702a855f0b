"""A complete robot simulator: robots that drive to within 1 m of the middle of those they heard. minimal.py [PORT]"""
import hashlib, math, os, random, struct, sys, tempfile
from concurrent import futures
from pathlib import Path
import grpc
from grpc_tools import protoc

PROTO = Path(__file__).resolve().parents[3] / "proto"
with tempfile.TemporaryDirectory() as stubs:
    files = [str(path) for path in PROTO.glob("cosim/v1/*.proto")]
    protoc.main(["protoc", f"-I{PROTO}", f"--python_out={stubs}", f"--grpc_python_out={stubs}", *files])
    sys.path.insert(0, stubs)
    from cosim.v1 import common_pb2 as common, robotsim_pb2 as pb, robotsim_pb2_grpc as service

def pack(letter, numbers):
    return struct.pack(f"<{len(numbers)}{letter}", *numbers)

def heard_by(robot, got):
    """The positions that a robot heard. The network sends bitmaps or lists of indices, whichever is shorter."""
    n, ends = len(got.transmissions.sender), [0, *(got.heard_end or [0] * (robot + 1))]
    row = int.from_bytes(got.heard_bitmap[robot * ((n + 7) // 8) : (robot + 1) * ((n + 7) // 8)], "little")
    indices = [i for i in range(n) if row >> i & 1] or got.heard[ends[robot] : ends[robot + 1]]
    return [struct.unpack_from("<3d", got.transmissions.payloads.data, 24 * i) for i in indices]

class Robots(service.RobotSimServiceServicer):
    step, time_ns, reply = None, 0, None  # not configured yet

    def Describe(self, request, context):
        return pb.RobotSimServiceDescribeResponse(name="minimal.py", version="1", contract_version=1)

    def Configure(self, request, context):
        place = random.Random(request.seed).uniform
        self.x_m, self.y_m = ([place(-6, 6) for _ in range(request.agent_count)] for _ in "xy")
        self.step, self.time_ns, self.reply = 0, 0, None
        return pb.RobotSimServiceConfigureResponse(states=self.states())

    def states(self):
        n = len(self.x_m)
        alive = ((1 << n) - 1).to_bytes((n + 7) // 8, "little")
        return common.AgentStates(alive=alive, x_m=self.x_m, y_m=self.y_m, z_m=[0.0] * n)

    def Step(self, request, context):
        if self.reply and request.step == self.step:
            return self.reply  # asked again
        if self.step is None or request.step != self.step + 1 or request.until_ns <= self.time_ns:
            context.abort(grpc.StatusCode.FAILED_PRECONDITION, f"step {request.step} cannot follow step {self.step}")
        reach_m = 1.0 * (request.until_ns - self.time_ns) / 1e9  # at 1 m/s
        for robot in range(len(self.x_m)):
            if heard := heard_by(robot, request.deliveries):
                dx, dy = (sum(axis) / len(heard) - own[robot] for axis, own in zip(zip(*heard), (self.x_m, self.y_m)))
                share = min(reach_m, max(0.0, math.hypot(dx, dy) - 1.0)) / (math.hypot(dx, dy) or 1.0)
                self.x_m[robot], self.y_m[robot] = self.x_m[robot] + share * dx, self.y_m[robot] + share * dy
        self.step, self.time_ns = request.step, request.until_ns
        said = [pack("d", (x, y, 0.0)) for x, y in zip(self.x_m, self.y_m)]
        payloads = common.Payloads(length_bytes=[24] * len(said), data=b"".join(said))
        states, got, air = self.states(), request.deliveries, request.deliveries.transmissions
        self.digest = hashlib.sha256(
            struct.pack("<2Q", self.step, self.time_ns) + states.alive + pack("d", [*states.x_m, *states.y_m, *states.z_m])
            + pack("I", air.sender) + pack("Q", [*air.sent_ns, *air.end_ns]) + pack("I", air.payloads.length_bytes)
            + air.payloads.data + pack("I", [*got.heard_end, *got.heard]) + got.heard_bitmap).digest()
        self.reply = pb.RobotSimServiceStepResponse(step=self.step, time_ns=self.time_ns, states=states, payloads=payloads)
        return self.reply

    def Barrier(self, request, context):
        if not self.reply:
            context.abort(grpc.StatusCode.FAILED_PRECONDITION, "step: none was taken yet")
        return pb.RobotSimServiceBarrierResponse(step=self.step, time_ns=self.time_ns, digest=self.digest)

def serve(robots):
    server = grpc.server(futures.ThreadPoolExecutor(max_workers=2))  # Describe is answered while a Step runs
    service.add_RobotSimServiceServicer_to_server(robots, server)
    address = os.environ.get("MURMURATION_LISTEN", f"127.0.0.1:{sys.argv[1] if sys.argv[1:] else 50061}")
    port = server.add_insecure_port(address)
    server.start()
    print("listening on", address if address.startswith("unix:") else f"127.0.0.1:{port}", flush=True)
    server.wait_for_termination()

if __name__ == "__main__":
    serve(Robots())
