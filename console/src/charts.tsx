// Small charts over mission time: of one drone, and of what the analytics scheduler decides.

import { useMemo } from "preact/hooks";
import { Chart, type Line } from "./chart";
import type { Flight } from "./flight";
import { Playback } from "./playback";
import type { AnalyticsOut } from "./wire";

/** Seconds over which rates are taken. */
const WINDOW = 5;

interface Drawn {
  name: string;
  unit: string;
  lines: Line[];
  /** Colour and text of what is told beside the name. */
  keys: [colour: string, text: string][];
  /** Largest figure of the vertical axis; without it, the axis fits the lines. */
  most?: number;
}

function ChartCard(props: { label: string; flight: Flight; times: number[]; charts: Drawn[] }) {
  const { label, flight, times, charts } = props;
  return (
    <section class="card charts" aria-label={label} data-testid={label.toLowerCase()}>
      {charts.map(({ name, unit, keys, ...chart }) => (
        <figure key={name}>
          <figcaption>
            {name} <small>{unit}</small>
            {keys.map(([colour, text]) => (
              <span key={colour} class={`key ${colour}`}>{text}</span>
            ))}
          </figcaption>
          <Chart {...{ times, ...chart, ...timeOf(flight) }} />
        </figure>
      ))}
    </section>
  );
}

export function Charts({ flight, robot }: { flight: Flight; robot: string }) {
  const samples = flight.history.get(robot) ?? [];
  const [times, charts] = useMemo(() => {
    const drawn = (name: string, unit: string, values: (number | null)[]): Drawn => {
      return { name, unit, keys: [], lines: [{ values, colour: "--accent" }] };
    };
    const percent = samples.map(({ battery }) => battery && 100 * battery);
    const all: Drawn[] = [
      drawn("Height", "m", samples.map((one) => one.height)),
      drawn("Speed", "m/s", samples.map((one) => one.speed)),
      { ...drawn("Battery", "%", percent), most: 100 },
    ];
    return [samples.map((one) => one.time), all];
  }, [samples]);
  return <ChartCard label="Charts" {...{ flight, times, charts }} />;
}

export function AnalyticsCharts({ flight }: { flight: Flight }) {
  const rows = flight.analytics;
  const rates = useMemo(() => ratesOf(rows), [rows]);
  const now = flight.source instanceof Playback ? flight.source.sums() : rows.at(-1);
  if (rows.length === 0) return null;
  const sums = now ?? { in_time: 0, late: 0, dropped: 0, edge: 0, cloud: 0, qos: 0, qoe: 0 };
  const { in_time, late, dropped, edge, cloud, qos, qoe } = sums;
  const idle = edge + cloud === 0 && in_time + late + dropped > 0;
  const line = (values: (number | null)[], colour: string): Line => ({ values, colour: `--${colour}` });
  const charts: Drawn[] = [
    {
      name: "Tasks",
      unit: "per second",
      keys: [["good", `${in_time} in time`], ["warn", `${late} late`], ["bad", `${dropped} dropped`]],
      lines: [line(rates.inTime, "good"), line(rates.late, "warn"), line(rates.dropped, "bad")],
    },
    {
      name: "On the edge",
      unit: "%",
      keys: [["accent", `${edge} edge, ${cloud} cloud${idle ? ": no task has run" : ""}`]],
      lines: [line(rates.edge, "accent")],
      most: 100,
    },
    {
      name: "Utility",
      unit: "",
      keys: [["r0", `${qos.toFixed(0)} QoS`], ["r1", `${qoe.toFixed(0)} QoE`]],
      lines: [line(rows.map((one) => one.qos), "r0"), line(rows.map((one) => one.qoe), "r1")],
    },
  ];
  return <ChartCard label="Analytics" times={rates.times} {...{ flight, charts }} />;
}

/** What a chart marks: the moment of a recording, which a click changes. */
function timeOf(flight: Flight): { cursor: number | null; onTime?: (time: number) => void } {
  const { source } = flight;
  if (!(source instanceof Playback)) return { cursor: null };
  return { cursor: source.time, onTime: (time) => source.seek(time) };
}

interface Rates {
  times: number[];
  inTime: (number | null)[];
  late: (number | null)[];
  dropped: (number | null)[];
  /** Share of the tasks that ran on the edge, per cent. */
  edge: (number | null)[];
}

function ratesOf(rows: AnalyticsOut[]): Rates {
  const rates: Rates = { times: [], inTime: [], late: [], dropped: [], edge: [] };
  let first = 0;
  rows.forEach((row, place) => {
    while (first < place - 1 && (rows[first]?.time ?? 0) < row.time - WINDOW) first += 1;
    const from = rows[first] ?? row;
    const seconds = row.time - from.time;
    const rate = (field: "in_time" | "late" | "dropped") =>
      seconds > 0 ? (row[field] - from[field]) / seconds : null;
    const edge = row.edge - (seconds > 0 ? from.edge : 0);
    const ran = edge + row.cloud - (seconds > 0 ? from.cloud : 0);
    rates.times.push(row.time);
    rates.inTime.push(rate("in_time"));
    rates.late.push(rate("late"));
    rates.dropped.push(rate("dropped"));
    rates.edge.push(ran > 0 ? (100 * edge) / ran : null);
  });
  return rates;
}
