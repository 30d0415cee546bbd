# docker build --build-arg UID=$(id -u) -t sva-bench .
# docker run --rm -v "$PWD:/work" sva-bench run my-world.yaml
FROM python:3.11-slim
COPY requirements-3.11.lock /tmp/
RUN python -m pip install --no-cache-dir --require-hashes --requirement /tmp/requirements-3.11.lock
COPY . /tmp/sva-bench
RUN python -m pip install --no-cache-dir --no-deps --no-build-isolation /tmp/sva-bench
# Whose files the results are: give it your own number, so that it may write to your folder.
ARG UID=1000
RUN useradd --create-home --uid $UID bench
USER bench
# Compiled code is kept in that user's home; worker processes would else compile it each on their own.
RUN sva-bench instance random --family B --pois 12 -o /tmp/warm.json && sva-bench plan /tmp/warm.json -o /tmp/warm-plan.json
WORKDIR /work
ENTRYPOINT ["sva-bench"]
