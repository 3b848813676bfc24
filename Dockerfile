# README's first two commands in a container: docker build -t rover_pin . && docker run --rm -it rover_pin rover-pin --help
FROM python:3.11-slim

# The time step is compiled on first use.
RUN apt-get update && apt-get install -y --no-install-recommends gcc libc6-dev && rm -rf /var/lib/apt/lists/*

RUN useradd --create-home rover
USER rover
WORKDIR /home/rover/rover_pin
COPY --chown=rover . .

# Nothing has a screen here: --open prints the path of the page instead.
ENV BROWSER=true MPLBACKEND=Agg PATH=/home/rover/rover_pin/.venv/bin:$PATH

RUN python3 -m venv .venv && . .venv/bin/activate && pip install -e ".[view]" && rover-pin close-loop cmu-smooth-wheel --open
RUN rover-pin drive ditch --set duration=30 --open
