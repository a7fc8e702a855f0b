"""The bridge as a ROS 2 node.  node.py [ADDRESS] [--step-service NAME] [--ros-args ...]. See README.md."""

import argparse
import sys
import threading

import rclpy
from geometry_msgs.msg import Twist
from nav_msgs.msg import Odometry
from rclpy.executors import SingleThreadedExecutor
from rclpy.qos import qos_profile_sensor_data
from rosgraph_msgs.msg import Clock
from std_msgs.msg import String

import bridge
import murmuration.robots

SERVICE_DEADLINE_S = 30.0
SETTLE_STEPS = 100  # clock and odometry are published only while the world runs


def nanoseconds(stamp):
    return stamp.sec * 1_000_000_000 + stamp.nanosec


class RosWorld:
    """Topics /robotI/odom, /robotI/cmd_vel, /robotI/heard and /clock; Gazebo's service to step the world, if it is named."""

    def __init__(self, node, step_service, physics_step_s, prefix):
        self.node, self.physics_step_ns, self.prefix = node, round(physics_step_s * 1e9), prefix
        self.mirror = bridge.Mirror()
        self.robots = {}
        # /clock is published as best effort.
        node.create_subscription(Clock, "/clock", lambda message: self.mirror.set_clock(nanoseconds(message.clock)), qos_profile_sensor_data)
        self.control = None
        if step_service:
            from ros_gz_interfaces.srv import ControlWorld

            self.control_type, self.control = ControlWorld, node.create_client(ControlWorld, step_service)

    def begin(self, n):
        for robot in range(len(self.robots), n):
            self.robots[robot] = self._connect(robot)
        if self.control is None:
            return 0
        if not self.control.wait_for_service(timeout_sec=SERVICE_DEADLINE_S):
            raise TimeoutError(f"no service {self.control.srv_name}")
        request = self.control_type.Request()
        request.world_control.pause = True
        request.world_control.reset.all = True
        self._call(request)
        self.mirror.clear()
        settle_ns = self.physics_step_ns * SETTLE_STEPS
        self.advance(settle_ns)
        return settle_ns

    def _connect(self, robot):
        name = self.prefix.replace("{}", str(robot))

        def on_odometry(message):
            at, q = message.pose.pose.position, message.pose.pose.orientation
            heading = bridge.yaw_rad(q.x, q.y, q.z, q.w)
            self.mirror.set_pose(robot, bridge.Pose(nanoseconds(message.header.stamp), at.x, at.y, at.z, heading))

        self.node.create_subscription(Odometry, f"{name}/odom", on_odometry, qos_profile_sensor_data)
        return self.node.create_publisher(Twist, f"{name}/cmd_vel", 10), self.node.create_publisher(String, f"{name}/heard", 10)

    def advance(self, dt_ns):
        if self.control is None:
            return
        if dt_ns % self.physics_step_ns:
            raise ValueError(f"a step of {dt_ns} ns is no multiple of the physics step of {self.physics_step_ns} ns; set experiment.control_period")
        request = self.control_type.Request()
        request.world_control.pause = True
        request.world_control.multi_step = dt_ns // self.physics_step_ns
        self._call(request)

    def _call(self, request):
        """Calls the service and waits; ROS's own thread receives the reply."""
        done = threading.Event()
        future = self.control.call_async(request)
        future.add_done_callback(lambda _: done.set())
        if not done.wait(SERVICE_DEADLINE_S):
            raise TimeoutError(f"{self.control.srv_name} did not reply within {SERVICE_DEADLINE_S:g} s")
        if not future.result().success:
            raise RuntimeError(f"{self.control.srv_name} refused {request.world_control}")

    def say(self, robot, text):
        self.robots[robot][1].publish(String(data=text))

    def drive(self, robot, speed_mps, yaw_rate_radps):
        command = Twist()
        command.linear.x, command.angular.z = float(speed_mps), float(yaw_rate_radps)
        self.robots[robot][0].publish(command)


def main(arguments):
    parser = argparse.ArgumentParser(description="Serve robots that live in ROS 2 as a robot simulator of Murmuration")
    parser.add_argument("address", nargs="?", help="127.0.0.1:PORT or unix:PATH; else MURMURATION_LISTEN, else a free port")
    parser.add_argument("--step-service", help="Gazebo's service, such as /world/default/control; without it the simulation runs by itself")
    parser.add_argument("--physics-step-s", type=float, default=0.001, help="physics step of the world (s)")
    parser.add_argument("--prefix", default="/robot{}", help="namespace of a robot, {} being its number")
    options, ros_arguments = parser.parse_known_args(arguments)
    rclpy.init(args=ros_arguments)
    node = rclpy.create_node("murmuration_bridge")
    world = RosWorld(node, options.step_service, options.physics_step_s, options.prefix)
    executor = SingleThreadedExecutor()
    executor.add_node(node)
    threading.Thread(target=executor.spin, daemon=True).start()
    murmuration.robots.serve(bridge.Bridge(world), options.address)


if __name__ == "__main__":
    main(sys.argv[1:])
