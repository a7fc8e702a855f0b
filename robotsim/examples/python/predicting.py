"""The robots of minimal.py with predictions, to be compared with recorded tracks. predicting.py [PORT]

A simulator of unicycles: it executes commands of speed and yaw rate, and knows one effect, `[[dynamics.effect]] kind = "slip"`.
"""
import math, tomllib
import grpc
from minimal import Robots, pb, serve

class Predicting(Robots):
    def Describe(self, request, context):
        said = super().Describe(request, context)
        said.name, said.predictions = "predicting.py", True
        return said

    def Predict(self, request, context):
        refuse = lambda why: context.abort(grpc.StatusCode.INVALID_ARGUMENT, why)
        if request.command_kind != pb.MOTION_COMMAND_KIND_SPEED_AND_YAW_RATE:
            refuse(f"command_kind: must be 2, speed and yaw rate, got {request.command_kind}")
        scale = 1.0
        for effect in tomllib.loads(request.config_toml).get("dynamics", {}).get("effect", []):
            if effect.get("kind") != "slip" or effect.get("on", "speed") != "speed":
                refuse(f"dynamics.effect: this simulator knows slip of the speed alone, got {effect}")
            scale *= effect["scale"]
        return pb.RobotSimServicePredictResponse(windows=[predicted(window, scale, refuse) for window in request.windows])

def predicted(window, scale, refuse):
    """Along arcs: speed and yaw rate are constant while a command holds."""
    x_m, y_m, heading_rad = window.x_m, window.y_m, window.heading_rad
    commands = list(zip(window.duration_ns, window.command_first, window.command_second))
    numbers = [x_m, y_m, window.z_m, heading_rad, *(number for command in commands for number in command)]
    if not commands or not all(map(math.isfinite, numbers)):
        refuse(f"windows: robot {window.agent} has no command, or a number that is not finite")
    reply = pb.PredictedWindow(agent=window.agent)
    for duration_ns, speed_mps, yaw_rate_radps in commands:
        way_m, turn_rad = scale * speed_mps * duration_ns / 1e9, yaw_rate_radps * duration_ns / 1e9
        chord = math.sin(turn_rad / 2) / (turn_rad / 2) if turn_rad else 1.0
        x_m += way_m * chord * math.cos(heading_rad + turn_rad / 2)
        y_m += way_m * chord * math.sin(heading_rad + turn_rad / 2)
        heading_rad += turn_rad
        reply.x_m.append(x_m), reply.y_m.append(y_m), reply.z_m.append(window.z_m), reply.heading_rad.append(heading_rad)
    return reply

if __name__ == "__main__":
    serve(Predicting())
