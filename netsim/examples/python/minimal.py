"""A complete network: robots hear each other within radius_m, and nothing is lost. minimal.py [PORT]"""
import hashlib, math, os, struct, sys, tempfile, tomllib
from concurrent import futures
from pathlib import Path
import grpc
from grpc_tools import protoc

PROTO = Path(__file__).resolve().parents[3] / "proto"
with tempfile.TemporaryDirectory() as stubs:
    files = [str(path) for path in PROTO.glob("cosim/v1/*.proto")]
    protoc.main(["protoc", f"-I{PROTO}", f"--python_out={stubs}", f"--grpc_python_out={stubs}", *files])
    sys.path.insert(0, stubs)
    from cosim.v1 import common_pb2 as common, netsim_pb2 as pb, netsim_pb2_grpc as service

def pack(letter, numbers):
    return struct.pack(f"<{len(numbers)}{letter}", *numbers)

class Disk(service.NetSimServiceServicer):
    step, time_ns, reply = None, 0, None  # not configured yet

    def Describe(self, request, context):
        return pb.NetSimServiceDescribeResponse(name="minimal.py", version="1", contract_version=1)

    def Configure(self, request, context):
        self.radius_m = tomllib.loads(request.config_toml).get("radius_m", 20.0)
        self.n, self.step, self.time_ns, self.reply, self.heard = request.agent_count, 0, 0, None, b""
        return pb.NetSimServiceConfigureResponse(motes=self.motes())

    def motes(self):
        return common.MoteStates(alive=((1 << self.n) - 1).to_bytes((self.n + 7) // 8, "little"))

    def Step(self, request, context):
        if self.reply and request.step == self.step:
            return self.reply  # asked again
        if self.step is None or request.step != self.step + 1 or request.until_ns <= self.time_ns:
            context.abort(grpc.StatusCode.FAILED_PRECONDITION, f"step {request.step} cannot follow step {self.step}")
        states, said = request.states, request.payloads
        if not self.n == len(states.x_m) == len(states.y_m) == len(states.z_m) or not all(map(math.isfinite, [*states.x_m, *states.y_m, *states.z_m])):
            context.abort(grpc.StatusCode.INVALID_ARGUMENT, f"states: x_m, y_m and z_m must have {self.n} finite entries each")
        place = list(zip(states.x_m, states.y_m, states.z_m))
        alive = [states.alive[i // 8] >> i % 8 & 1 for i in range(self.n)]
        ends = [sum(said.length_bytes[: i + 1]) for i in range(len(said.length_bytes))]
        senders = [i for i, length in enumerate(said.length_bytes) if length and alive[i]]
        lists = [[k for k, i in enumerate(senders) if alive[r] and i != r and math.dist(place[i], place[r]) <= self.radius_m] for r in range(self.n)]
        air = common.Transmissions(
            sender=senders, sent_ns=[self.time_ns] * len(senders), end_ns=[request.until_ns] * len(senders),
            payloads=common.Payloads(length_bytes=[said.length_bytes[i] for i in senders],
                                     data=b"".join(said.data[ends[i] - said.length_bytes[i] : ends[i]] for i in senders)))
        heard_end = [sum(map(len, lists[: r + 1])) for r in range(self.n)] if senders else []
        got = common.Deliveries(transmissions=air, heard_end=heard_end, heard=sum(lists, []))
        self.step, self.time_ns = request.step, request.until_ns
        # The digest has the deliveries that the robots were given in this step: those of the period before.
        text = struct.pack("<2Q", self.step, self.time_ns) + states.alive + pack("d", [*states.x_m, *states.y_m, *states.z_m])
        self.digest = hashlib.sha256(text + self.heard).digest()
        self.heard = (pack("I", air.sender) + pack("Q", [*air.sent_ns, *air.end_ns]) + pack("I", air.payloads.length_bytes)
                      + air.payloads.data + pack("I", [*got.heard_end, *got.heard]))
        self.reply = pb.NetSimServiceStepResponse(step=self.step, time_ns=self.time_ns, deliveries=got, motes=self.motes())
        return self.reply

    def Barrier(self, request, context):
        if not self.reply:
            context.abort(grpc.StatusCode.FAILED_PRECONDITION, "step: none was taken yet")
        return pb.NetSimServiceBarrierResponse(step=self.step, time_ns=self.time_ns, digest=self.digest)

if __name__ == "__main__":
    server = grpc.server(futures.ThreadPoolExecutor(max_workers=2))  # Describe is answered while a Step runs
    service.add_NetSimServiceServicer_to_server(Disk(), server)
    address = os.environ.get("MURMURATION_LISTEN", f"127.0.0.1:{sys.argv[1] if sys.argv[1:] else 50051}")
    port = server.add_insecure_port(address)
    server.start()
    print("listening on", address if address.startswith("unix:") else f"127.0.0.1:{port}", flush=True)
    server.wait_for_termination()
