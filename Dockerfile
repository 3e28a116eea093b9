# The service in a slim image: docs/service.md says how it is run.
FROM rust:1.89-slim-bookworm AS build
# METIS and SQLite are built from C sources. The compiler is the distribution's, whichever that is when the image is built.
# hadolint ignore=DL3008
RUN apt-get update && apt-get install -y --no-install-recommends gcc libc6-dev && rm -rf /var/lib/apt/lists/*
WORKDIR /source
COPY Cargo.toml Cargo.lock ./
COPY src src
COPY benches benches
COPY examples examples
COPY tests tests
COPY geometries geometries
RUN cargo build --release --locked --bin lambdak

FROM debian:bookworm-slim
RUN groupadd --system --gid 10001 lambdak \
    && useradd --system --uid 10001 --gid lambdak --home-dir /data --shell /usr/sbin/nologin lambdak \
    && install -d -o lambdak -g lambdak -m 0750 /data
COPY --from=build /source/target/release/lambdak /usr/local/bin/lambdak
COPY LICENSE-APACHE LICENSE-MIT docs/licences.md /usr/share/doc/lambdak/
# A number, so that whoever starts the container sees without asking it that this is not root.
USER 10001:10001
WORKDIR /data
VOLUME /data
EXPOSE 8080
# The storage answers. The slim image has no curl; bash opens the connection itself.
HEALTHCHECK --interval=15s --timeout=5s --start-period=20s --retries=3 CMD ["bash", "-c", "exec 3<>/dev/tcp/127.0.0.1/8080 && printf 'GET /readyz HTTP/1.1\\r\\nHost: 127.0.0.1\\r\\nConnection: close\\r\\n\\r\\n' >&3 && read -r line <&3 && [[ $line == *' 200 '* ]]"]
ENTRYPOINT ["lambdak"]
# Beyond this machine the service asks for tokens: docs/service.md makes the first.
CMD ["serve", "--listen", "0.0.0.0:8080", "--data", "/data", "--tokens", "/data/tokens.json"]
