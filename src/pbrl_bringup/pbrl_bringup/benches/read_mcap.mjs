// Reads an MCAP file with @mcap/core and decodes every message: node read_mcap.mjs FILE
// Prints {topic: count} as JSON. Exit code 1 and one line on stderr where a message does not decode.
// Needs: npm i @mcap/core @mcap/support @foxglove/rosmsg @foxglove/rosmsg2-serialization (in the current folder).

import { open } from "node:fs/promises";
import { createRequire } from "node:module";
import path from "node:path";
import process from "node:process";

// Packages are looked up from the current folder, where npm put them, not from beside this script.
const require = createRequire(path.join(process.cwd(), "package.json"));
const { McapIndexedReader } = require("@mcap/core");
const { loadDecompressHandlers } = require("@mcap/support");
const { parse } = require("@foxglove/rosmsg");
const { MessageReader } = require("@foxglove/rosmsg2-serialization");

// The two calls that @mcap/core makes of a file.
function readable(handle) {
  return {
    size: async () => BigInt((await handle.stat()).size),
    read: async (offset, length) => {
      const buffer = new Uint8Array(Number(length));
      const { bytesRead } = await handle.read(buffer, 0, buffer.length, Number(offset));
      if (bytesRead !== buffer.length) {
        throw new Error(`expected ${length} bytes at ${offset}, got ${bytesRead}`);
      }
      return buffer;
    },
  };
}

async function main(file) {
  const handle = await open(file, "r");
  const reader = await McapIndexedReader.Initialize({
    readable: readable(handle),
    decompressHandlers: await loadDecompressHandlers(),
  });
  if (reader.header.profile !== "ros2") {
    throw new Error(`expected profile ros2, got '${reader.header.profile}'`);
  }
  const decoders = new Map();
  const counts = {};
  for await (const message of reader.readMessages()) {
    const channel = reader.channelsById.get(message.channelId);
    const schema = reader.schemasById.get(channel.schemaId);
    if (!decoders.has(channel.id)) {
      if (channel.messageEncoding !== "cdr" || schema.encoding !== "ros2msg") {
        throw new Error(`${channel.topic}: expected cdr and ros2msg, got ${channel.messageEncoding} and ${schema.encoding}`);
      }
      const definition = parse(new TextDecoder().decode(schema.data), { ros2: true });
      decoders.set(channel.id, new MessageReader(definition));
    }
    try {
      decoders.get(channel.id).readMessage(message.data);
    } catch (error) {
      throw new Error(`${channel.topic}: ${schema.name} at ${message.logTime}: ${error.message}`);
    }
    counts[channel.topic] = (counts[channel.topic] ?? 0) + 1;
  }
  await handle.close();
  const expected = reader.statistics?.messageCount;
  const total = Object.values(counts).reduce((sum, count) => sum + count, 0);
  if (expected !== undefined && BigInt(total) !== expected) {
    throw new Error(`expected ${expected} messages by the statistics, got ${total}`);
  }
  console.log(JSON.stringify(counts));
}

if (process.argv.length !== 3) {
  console.error("read_mcap: expected one argument, an MCAP file");
  process.exit(2);
}
main(process.argv[2]).catch((error) => {
  console.error(`read_mcap: ${process.argv[2]}: ${error.message}`);
  process.exit(1);
});
