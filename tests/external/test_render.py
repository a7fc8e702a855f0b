"""Videos that `murmuration render` makes through ffmpeg, as ffprobe reads them."""

import json
import shutil
import subprocess

import pytest
from conftest import program, succeed

SIZE = (640, 360)


def probed(path):
    """The one stream of a file, all frames counted."""
    fields = "codec_name,width,height,pix_fmt,r_frame_rate,nb_read_frames,color_space,duration"
    command = ["ffprobe", "-v", "error", "-count_frames", "-show_entries", f"stream={fields}:format=duration", "-of", "json", path]
    found = json.loads(succeed(command))
    assert len(found["streams"]) == 1
    return found["streams"][0], float(found["format"]["duration"])


def pixels(path, frame):
    """One frame of a file as bytes R, G, B."""
    command = ["ffmpeg", "-v", "error", "-i", path, "-vf", f"select=eq(n\\,{frame})", "-frames:v", "1", "-f", "rawvideo", "-pix_fmt", "rgb24", "-"]
    return subprocess.run(command, check=True, capture_output=True, timeout=60, stdin=subprocess.DEVNULL).stdout


@pytest.mark.parametrize(("name", "codec"), [("a.mp4", "h264"), ("a.webm", "vp9"), ("a.gif", "gif")])
def test_a_video_has_its_frames_size_and_duration(flocking, tmp_path, name, codec):
    assert shutil.which("ffprobe"), "ffmpeg is missing: tests/external/run installs it"
    path = tmp_path / name
    width, height = SIZE
    command = [program("murmuration"), "render", flocking, "--video", path, "--speed", "4", "--fps", "10", "--size", f"{width}x{height}"]
    said = succeed(command)
    stream, duration_s = probed(path)
    n_frames = int(stream["nb_read_frames"])
    assert f"{n_frames} frames at 10 frames/s" in said
    assert (stream["codec_name"], stream["width"], stream["height"]) == (codec, width, height)
    assert stream["r_frame_rate"] == "10/1"
    # 25 s of the run, 0.4 s a frame, both ends included.
    assert n_frames == 63
    assert duration_s == pytest.approx(6.3, abs=0.11)
    if codec != "gif":
        assert (stream["pix_fmt"], stream["color_space"]) == ("yuv420p", "bt709")
    first, last = pixels(path, 0), pixels(path, n_frames - 1)
    assert len(first) == len(last) == 3 * width * height
    # White corners, and robots that have moved.
    assert all(value > 245 for value in first[:30])
    moved = sum(abs(a - b) > 40 for a, b in zip(first, last))
    assert moved > 200
    assert [entry.name for entry in tmp_path.iterdir()] == [name]


def test_a_picture_is_that_frame_of_the_video(flocking, tmp_path):
    size = f"{SIZE[0]}x{SIZE[1]}"
    succeed([program("murmuration"), "render", flocking, "--at", "10", "--output", tmp_path / "a.png", "--size", size])
    part = ["--from", "10", "--until", "10"]
    succeed([program("murmuration"), "render", flocking, "--video", tmp_path / "a.mp4", "--size", size, *part])
    picture, frame = pixels(tmp_path / "a.png", 0), pixels(tmp_path / "a.mp4", 0)
    assert len(picture) == len(frame)
    far = sum(abs(a - b) > 60 for a, b in zip(picture, frame))
    assert far < len(picture) / 100
