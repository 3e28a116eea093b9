"""Reads `cargo metadata` and writes the page of licences: every crate that the program is built of on any machine."""

import json
import sys

HEAD = """# Licences of what the program is built of

Written by `.ci/licences` from `Cargo.lock`; `deny.toml` says which licences are accepted. Crates that only tests use are left out. The C library
METIS (Apache-2.0) is part of `metis-sys`, SQLite (public domain) of `libsqlite3-sys`.

| Crate | Version | Licence |
|---|---|---|
"""


def main():
    described = json.load(sys.stdin)
    nodes = {node["id"]: node for node in described["resolve"]["nodes"]}
    packages = {package["id"]: package for package in described["packages"]}
    reached, waiting = set(), [described["resolve"]["root"]]
    while waiting:
        one = waiting.pop()
        if one in reached:
            continue
        reached.add(one)
        # A dependency without a kind is neither of tests nor of the build alone.
        kinds = lambda dependency: {kind["kind"] for kind in dependency["dep_kinds"]}
        waiting += [d["pkg"] for d in nodes[one]["deps"] if kinds(d) & {None, "build"}]
    reached.discard(described["resolve"]["root"])
    rows = sorted((packages[one]["name"], packages[one]["version"], packages[one]["license"]) for one in reached)
    missing = [name for name, _, licence in rows if not licence]
    if missing:
        raise SystemExit(f"crates without a licence: {', '.join(missing)}")
    print(HEAD + "\n".join(f"| {name} | {version} | {licence} |" for name, version, licence in rows))


if __name__ == "__main__":
    main()
