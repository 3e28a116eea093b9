"""Ctrl-C, errors of the progress callback, time limits: the program ends in good order, what it found is kept."""

import json
import os
import re
import signal
import subprocess
import sys
import threading
import time
import unittest
from pathlib import Path

from shared import Scratch, bar, environment, study

import lambdak as lk

# A shell's background jobs ignore SIGINT, and Python with them: these tests may be run in one.
SEARCH = """
import signal
import sys
from pathlib import Path
from shared import study
import lambdak as lk

signal.signal(signal.SIGINT, signal.default_int_handler)
folder = Path(sys.argv[1]) if len(sys.argv) > 1 else None
try:
    lk.design(study(), folder=folder, on_progress=lambda text: print(text, flush=True))
except KeyboardInterrupt as stopped:
    print(f"STOPPED|{stopped}", flush=True)
    raise
"""


def programs_of(pid):
    listed = subprocess.run(["ps", "-o", "pid=,comm=", "--ppid", str(pid)], capture_output=True, text=True, check=False)
    rows = [line.split() for line in listed.stdout.splitlines()]
    return [int(number) for number, name in rows if name == "lambdak"]


def is_running(pid):
    try:
        os.kill(pid, 0)
    except ProcessLookupError:
        return False
    with open(f"/proc/{pid}/stat", encoding="ascii") as file:
        return file.read().rsplit(")", 1)[1].split()[0] != "Z"


@unittest.skipUnless(sys.platform == "linux", "it looks for processes in /proc")
class CtrlC(Scratch):
    def searching(self, *arguments):
        """A search in a process group of its own, as a shell starts one, once it has begun to explore."""
        process = subprocess.Popen(
            [sys.executable, "-c", SEARCH, *arguments],
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            text=True,
            # Python that is killed leaves its request behind.
            env={**environment(), "TMPDIR": str(self.folder)},
            start_new_session=True,
        )
        self.addCleanup(process.communicate)
        self.addCleanup(process.kill)
        lines = []
        for line in process.stdout:
            lines.append(line)
            if "explore: " in line:
                break
        self.assertTrue(lines and "explore" in lines[-1], process.stderr.read() if not lines else lines)
        (program,) = programs_of(process.pid)
        # Whatever goes wrong in a test, nothing goes on after it.
        self.addCleanup(lambda: is_running(program) and os.kill(program, signal.SIGKILL))
        return process, program

    def test_ctrl_c_ends_the_program_in_good_order_and_keeps_what_was_found(self):
        process, program = self.searching(str(self.folder / "results"))
        # A terminal sends it to the whole group; twice, from there and from Python, it would end the program at once.
        self.assertNotEqual(os.getpgid(program), os.getpgid(process.pid))
        os.killpg(process.pid, signal.SIGINT)
        output, error = process.communicate(timeout=60)
        (line,) = [line for line in output.splitlines() if line.startswith("STOPPED")]
        unfinished = self.folder / "results" / "unfinished-design.json"
        self.assertRegex(line, f"stopped after .* What was found is in {unfinished}; run the same command again")
        self.assertEqual(json.loads(unfinished.read_text())["is_finished"], False)
        self.assertTrue((self.folder / "results" / "checkpoint.jsonl").is_file())
        self.assertEqual(process.returncode, -signal.SIGINT, "Python ends as by Ctrl-C")
        self.assertIn("KeyboardInterrupt: stopped; ", error)
        self.assertFalse(is_running(program))

    def test_what_was_found_outlives_python_without_a_folder_too(self):
        process, program = self.searching()
        process.send_signal(signal.SIGINT)
        output, _ = process.communicate(timeout=60)
        found = Path(re.search(r"What was found is in (.*); run", output)[1])
        self.assertTrue(found.is_file())
        self.assertFalse(is_running(program))
        self.assertEqual(found.parents[1], self.folder, "it was made where temporary folders are")

    def test_a_program_that_does_not_answer_is_killed_by_the_third_ctrl_c(self):
        process, program = self.searching(str(self.folder))
        os.kill(program, signal.SIGSTOP)
        os.killpg(process.pid, signal.SIGINT)
        time.sleep(0.5)
        os.killpg(process.pid, signal.SIGINT)
        time.sleep(0.5)
        os.killpg(process.pid, signal.SIGINT)
        process.communicate(timeout=60)
        self.assertFalse(is_running(program))

    def test_the_program_does_not_outlive_python(self):
        process, program = self.searching(str(self.folder))
        process.kill()
        process.communicate()
        end = time.monotonic() + 30
        while is_running(program) and time.monotonic() < end:
            time.sleep(0.2)
        self.assertFalse(is_running(program))


class Callback(Scratch):
    @unittest.skipUnless(sys.platform == "linux", "it looks for processes in /proc")
    def test_a_program_that_somebody_else_stops_is_an_error_of_its_own(self):
        stopped = []

        def on_progress(text):
            # A second signal would end the program at once.
            if "explore: " in text and not stopped:
                stopped.extend(programs_of(os.getpid()))
                os.kill(stopped[0], signal.SIGINT)

        with self.assertRaisesRegex(lk.Stopped, "stopped after") as caught:
            lk.design(study(), folder=self.folder, on_progress=on_progress)
        self.assertNotIsInstance(caught.exception, lk.TimeLimitError)
        self.assertEqual((caught.exception.folder, caught.exception.unfinished["is_finished"]), (self.folder, False))

    def test_an_error_of_the_callback_stops_the_program_and_is_raised(self):
        class Enough(Exception):
            pass

        def on_progress(text):
            if "explore: " in text:
                raise Enough(text)

        with self.assertRaisesRegex(Enough, "explore: "):
            lk.design(study(), folder=self.folder, on_progress=on_progress)
        self.assertTrue((self.folder / "unfinished-design.json").is_file())
        # The same call with the same folder goes on from there.
        lines = []
        with self.assertRaises(Enough):
            lk.design(study(), folder=self.folder, on_progress=lambda text: (lines.append(text), on_progress(text)))
        self.assertRegex(lines[0], "resuming: [1-9][0-9]* evaluations taken from the checkpoint")

    def test_a_time_limit_is_an_error_with_what_was_found(self):
        with self.assertRaisesRegex(lk.TimeLimitError, "run the same command again to go on") as caught:
            lk.design(study(), folder=self.folder, time_limit_min=0.05)
        self.assertEqual(caught.exception.unfinished["is_finished"], False)
        self.assertEqual(caught.exception.folder, self.folder)

    def test_progress_comes_while_the_program_runs(self):
        times = []
        solution = lk.solve(
            bar(drive_mm=[2, 4, 6, 8]), mesh=0.6, on_progress=lambda text: times.append((time.monotonic(), text))
        )
        end = time.monotonic()
        self.assertIn("solving drive 2 mm", times[0][1])
        self.assertGreater(end - times[0][0], 0.05, "the first line came at the end")
        self.assertEqual(len(solution.steps), 4)


class Threads(Scratch):
    def test_python_goes_on_meanwhile(self):
        count, done = [0], threading.Event()

        def counting():
            while not done.is_set():
                count[0] += 1
                time.sleep(0.001)

        counter = threading.Thread(target=counting)
        counter.start()
        begin = time.monotonic()
        lk.solve(bar(), mesh="fine")
        took = time.monotonic() - begin
        done.set()
        counter.join()
        self.assertGreater(count[0], 50 * took)

    def test_calls_from_threads_are_those_of_the_main_thread(self):
        from concurrent.futures import ThreadPoolExecutor

        diameters = [3.0, 4.0, 5.0]

        def force(diameter_mm):
            return lk.solve(bar(holes=[lk.Hole((0, 0), diameter_mm)]), mesh="search", threads=1).steps[0].force_n

        with ThreadPoolExecutor(3) as pool:
            together = list(pool.map(force, diameters))
        self.assertEqual(together, [force(diameter) for diameter in diameters])
        self.assertGreater(together[0], together[2])


if __name__ == "__main__":
    unittest.main()
