# SPDX-License-Identifier: BSD-3-Clause
# docker build -t cairn . && docker run --rm -v "$PWD:/data" cairn align source.map target.map
FROM debian:12 AS build
COPY scripts/setup /cairn/scripts/setup
RUN /cairn/scripts/setup build \
 && apt-get install -y --no-install-recommends python3-dev python3-numpy pybind11-dev dpkg-dev file
COPY . /cairn
WORKDIR /cairn
RUN cmake --preset release -DCAIRN_BUILD_TESTS=OFF -DCAIRN_BUILD_EXAMPLES=OFF -DCAIRN_WITH_PCL=OFF \
 && cmake --build build/release && cmake --build build/release --target package

FROM debian:12-slim
COPY --from=build /cairn/build/release/packages/cairn_*.deb /cairn/build/release/packages/python3-cairn_*.deb /packages/
RUN apt-get update && apt-get install -y --no-install-recommends /packages/*.deb \
 && rm -rf /var/lib/apt/lists/* /packages
WORKDIR /data
ENTRYPOINT ["cairn"]
CMD ["--help"]
