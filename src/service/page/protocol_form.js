// The fields of a protocol: forces read on the way, what is unknown of load cell and drive, samples that are scanned.

import { field, fields } from "./field.js";
import { plain } from "./numbers.js";

/** Sets a part of the plan's protocol, or takes it out. */
function put(model, key, value) {
  const { [key]: _, ...others } = model.protocol;
  model.protocol = value === undefined ? others : { ...others, [key]: value };
}

/** What is asked of a protocol: key, label, kind, example, meaning, and how the number is shown. */
const ASKED = [
  [
    "force_drive_mm",
    "Forces read at, mm",
    "optionalNumbers",
    "2.5, 5",
    "Drives at which the load cell is read on the way to a scan. It takes no time in the scanner, and tells terms apart.",
  ],
  [
    "force_gain_sd",
    "Load cell’s gain, known to, %",
    "optional",
    "1",
    "One standard deviation, of all its readings alike. Empty: known exactly.",
    100,
  ],
  [
    "force_zero_sd_n",
    "Load cell’s zero, known to, N",
    "optional",
    "0.05",
    "One standard deviation, of all its readings alike. Empty: known exactly.",
  ],
  [
    "drive_zero_sd_mm",
    "Zero of the drive, known to, mm",
    "optional",
    "0.05",
    "One standard deviation: every drive is as much too large or too small. Empty: known exactly.",
  ],
  [
    "plate_tilt_sd_deg",
    "Angles of the moved plate, known to, °",
    "optional",
    "0.5",
    "One standard deviation about each axis, at every drive alike. Empty: known exactly.",
  ],
  [
    "blocks_scanned",
    "Samples scanned",
    "optionalWhole",
    "2",
    "Samples that lie in the scanner together, each with its own voxels. Empty: the first one alone.",
  ],
  [
    "scan_share",
    "Shares of the scan time",
    "optionalNumbers",
    "0.5, 0.5",
    "One for each scanned drive, together at most 1: noise grows as 1/√share. Empty: the time of a whole scan for each.",
  ],
];

/** The protocol's fields. */
export const protocolForm = (model, edited) =>
  fields(
    ASKED.map(([key, label, kind, example, meaning, scale = 1]) => {
      const value = model.protocol[key];
      return field({
        label,
        kind,
        value: typeof value === "number" ? plain(value * scale) : value?.join(", "),
        example,
        pointer: `/protocol/${key}`,
        put: (v) => put(model, key, typeof v === "number" ? v / scale : v),
        placeholder: "none",
        meaning,
        changed: edited,
      });
    }),
  );
