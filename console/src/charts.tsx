// Small charts over mission time: of one drone, and of what the analytics scheduler decides.

import { useMemo } from "preact/hooks";
import { Chart } from "./chart";
import type { Flight, Sample } from "./flight";
import { Playback } from "./playback";
import type { AnalyticsOut } from "./wire";

interface ChartsProps {
  flight: Flight;
  robot: string;
  theme: string;
}

const FIGURES: { key: "height" | "speed" | "battery"; name: string; unit: string }[] = [
  { key: "height", name: "Height", unit: "m" },
  { key: "speed", name: "Speed", unit: "m/s" },
  { key: "battery", name: "Battery", unit: "%" },
];

export function Charts({ flight, robot, theme }: ChartsProps) {
  const samples = flight.history.get(robot) ?? [];
  const times = useMemo(() => samples.map((one) => one.time), [samples]);
  return (
    <section class="card charts" aria-label="Charts">
      {FIGURES.map(({ key, name, unit }) => (
        <figure key={key}>
          <figcaption>
            {name} <small>{unit}</small>
          </figcaption>
          <Figure {...{ flight, samples, times, theme }} field={key} />
        </figure>
      ))}
    </section>
  );
}

function Figure(props: {
  flight: Flight;
  samples: Sample[];
  times: number[];
  theme: string;
  field: "height" | "speed" | "battery";
}) {
  const { flight, samples, times, theme, field } = props;
  const values = useMemo(() => {
    const factor = field === "battery" ? 100 : 1;
    return samples.map((one) => (one[field] === null ? null : one[field] * factor));
  }, [samples, field]);
  const lines = [{ values, colour: "--accent" }];
  const most = field === "battery" ? { most: 100 } : {};
  return <Chart {...{ times, lines, theme, ...most, ...timeOf(flight) }} />;
}

/** Seconds over which rates are taken. */
const WINDOW = 5;

export function AnalyticsCharts({ flight, theme }: { flight: Flight; theme: string }) {
  const rows = flight.analytics;
  const rates = useMemo(() => ratesOf(rows), [rows]);
  const now = flight.source instanceof Playback ? flight.source.sums() : rows.at(-1);
  if (rows.length === 0) return null;
  const shared = { times: rates.times, theme, ...timeOf(flight) };
  const tasks = (now?.in_time ?? 0) + (now?.late ?? 0) + (now?.dropped ?? 0);
  const placed = (now?.edge ?? 0) + (now?.cloud ?? 0);
  return (
    <section class="card charts" aria-label="Analytics" data-testid="analytics">
      <figure>
        <figcaption>
          Tasks <small>a second</small>{" "}
          <Key colour="good" text={`${now?.in_time ?? 0} in time`} />
          <Key colour="warn" text={`${now?.late ?? 0} late`} />
          <Key colour="bad" text={`${now?.dropped ?? 0} dropped`} />
        </figcaption>
        <Chart
          {...shared}
          lines={[
            { values: rates.inTime, colour: "--good" },
            { values: rates.late, colour: "--warn" },
            { values: rates.dropped, colour: "--bad" },
          ]}
        />
      </figure>
      <figure>
        <figcaption>
          On the edge <small>%</small>{" "}
          <Key colour="accent" text={`${now?.edge ?? 0} edge, ${now?.cloud ?? 0} cloud`} />
          {placed === 0 && tasks > 0 && " none has run"}
        </figcaption>
        <Chart {...shared} lines={[{ values: rates.edge, colour: "--accent" }]} most={100} />
      </figure>
      <figure>
        <figcaption>
          Utility <Key colour="r0" text={`${(now?.qos ?? 0).toFixed(0)} QoS`} />
          <Key colour="r1" text={`${(now?.qoe ?? 0).toFixed(0)} QoE`} />
        </figcaption>
        <Chart
          {...shared}
          lines={[
            { values: rows.map((one) => one.qos), colour: "--r0" },
            { values: rows.map((one) => one.qoe), colour: "--r1" },
          ]}
        />
      </figure>
    </section>
  );
}

function Key({ colour, text }: { colour: string; text: string }) {
  return <span class={`key ${colour}`}>{text}</span>;
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
