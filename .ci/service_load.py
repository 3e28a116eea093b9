"""Readers and event streams against a running service: python service_load.py ADDRESS SECONDS|until-it-ends [READERS] [PID].

Every reader asks for a job about 2.5 times a second; every stream follows it. Prints requests, failures, slowest answers and,
with the service's process id, the processor time that serving took.
"""

import asyncio
import sys
import time
import urllib.request
import json

address = sys.argv[1].rstrip("/")
# `until-it-ends` goes on until the newest job has ended, so that the load covers it.
is_open_ended = sys.argv[2] == "until-it-ends"
seconds = 3600.0 if is_open_ended else float(sys.argv[2])
count = int(sys.argv[3]) if len(sys.argv) > 3 else 200
pid = sys.argv[4] if len(sys.argv) > 4 else None
host, port = address.removeprefix("http://").split(":")
jobs = json.load(urllib.request.urlopen(f"{address}/v1/jobs?limit=1"))["jobs"]
path = f"/v1/jobs/{jobs[0]['id']}"
times, failures, events, has_ended = [], [], 0, False


def processor():
    fields = open(f"/proc/{pid}/stat").read().rsplit(")", 1)[1].split()
    return (int(fields[11]) + int(fields[12])) / 100


async def reader(end):
    global has_ended
    stream_in, stream_out = await asyncio.open_connection(host, int(port))
    while time.monotonic() < end and not has_ended:
        start = time.monotonic()
        stream_out.write(f"GET {path} HTTP/1.1\r\nhost: {host}:{port}\r\n\r\n".encode())
        head = await stream_in.readuntil(b"\r\n\r\n")
        length = int(next(l for l in head.lower().split(b"\r\n") if l.startswith(b"content-length")).split(b":")[1])
        body = await stream_in.readexactly(length)
        has_ended |= is_open_ended and b'"finished_ms"' in body
        times.append(time.monotonic() - start)
        if not head.startswith(b"HTTP/1.1 200"):
            failures.append(head)
        await asyncio.sleep(0.375)
    stream_out.close()


async def follower(end):
    global events
    stream_in, stream_out = await asyncio.open_connection(host, int(port))
    stream_out.write(f"GET {path}/events HTTP/1.1\r\nhost: {host}:{port}\r\n\r\n".encode())
    head = await stream_in.readuntil(b"\r\n\r\n")
    if not head.startswith(b"HTTP/1.1 200"):
        failures.append(head)
    try:
        while time.monotonic() < end:
            line = await asyncio.wait_for(stream_in.readline(), max(0.01, end - time.monotonic()))
            events += line.startswith(b"event: job")
            if not line:
                break
    except (asyncio.TimeoutError, TimeoutError):
        pass
    stream_out.close()


async def main():
    end = time.monotonic() + seconds
    results = await asyncio.gather(*[f(end) for _ in range(count) for f in (reader, follower)], return_exceptions=True)
    failures.extend(r for r in results if isinstance(r, BaseException))


before, began = processor() if pid else 0, time.monotonic()
asyncio.run(main())
times.sort()
print(f"{count} readers and {count} streams for {time.monotonic() - began:.0f} s: {len(times)} requests, {events} events, {len(failures)} failures, "
      f"median {1e3 * times[len(times) // 2]:.1f} ms, 99 % {1e3 * times[int(0.99 * len(times))]:.1f} ms")
if pid:
    print(f"processor time of the service: {processor() - before:.2f} s")
sys.exit(bool(failures))
