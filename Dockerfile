# lidarlift as a command. Not built by the project's own checks so far.
#   docker build -t lidarlift .
#   docker run --rm -v "$PWD:/data" lidarlift run /data/my_scans --sensor vlp16 --out /data/runs/mine
FROM python:3.11-slim-bookworm
RUN apt-get update \
    && apt-get install -y --no-install-recommends libusb-1.0-0 libgomp1 libgl1 libx11-6 \
    && rm -rf /var/lib/apt/lists/*
WORKDIR /lidarlift
COPY . .
RUN pip install --no-cache-dir -c constraints.txt .
# Compiled kernels, for any user of the container; on another CPU they are compiled again.
ENV NUMBA_CACHE_DIR=/var/cache/lidarlift
RUN cd / && python -m lidarlift.preparing; chmod -R a+rwX /var/cache/lidarlift
WORKDIR /data
ENTRYPOINT ["lidarlift"]
