"""Reads an MCAP with the `mcap` of PyPI, not knowing who wrote it: channels with schemas, times and messages, as JSON.

    read_mcap.py FILE
"""

import json
import sys

from mcap.reader import make_reader
from mcap.stream_reader import StreamReader


def main():
    with open(sys.argv[1], "rb") as file:
        # Once from start to end with all checksums, once by the index at the end, as viewers do.
        records = sum(1 for _ in StreamReader(file, validate_crcs=True).records)
        file.seek(0)
        reader = make_reader(file, validate_crcs=True)
        counted = reader.get_summary().statistics.message_count
        metadata = {record.name: record.metadata for record in reader.iter_metadata()}
        channels, in_file = {}, []
        for schema, channel, message in reader.iter_messages(log_time_order=False):
            assert (schema.encoding, channel.message_encoding) == ("jsonschema", "json"), channel.topic
            contents = channels.setdefault(channel.topic, {"schema": json.loads(schema.data), "times_ns": [], "messages": []})
            assert message.sequence == len(contents["messages"]), f"{channel.topic}: a hole before {message.sequence}"
            contents["times_ns"].append(message.log_time)
            contents["messages"].append(json.loads(message.data))
            in_file.append(message.log_time)
    assert counted == len(in_file) < records
    # At once, by the encoder in C: json.dump has one in Python.
    print(json.dumps({"sorted": in_file == sorted(in_file), "metadata": metadata, "channels": channels}))


if __name__ == "__main__":
    main()
