// Small live charts of one drone over mission time.

import { useEffect, useRef } from "preact/hooks";
import uPlot from "uplot";
import "uplot/dist/uPlot.min.css";
import type { Flight, Sample } from "./flight";

const CHARTS: { key: "height" | "speed" | "battery"; name: string; unit: string }[] = [
  { key: "height", name: "Height", unit: "m" },
  { key: "speed", name: "Speed", unit: "m/s" },
  { key: "battery", name: "Battery", unit: "%" },
];

export function Charts({ flight, robot, theme }: { flight: Flight; robot: string; theme: string }) {
  const samples = flight.history.get(robot) ?? [];
  return (
    <section class="card charts" aria-label="Charts">
      {CHARTS.map(({ key, name, unit }) => (
        <figure key={key}>
          <figcaption>
            {name} <small>{unit}</small>
          </figcaption>
          <Chart samples={samples} field={key} theme={theme} />
        </figure>
      ))}
    </section>
  );
}

function Chart(props: { samples: Sample[]; field: "height" | "speed" | "battery"; theme: string }) {
  const box = useRef<HTMLDivElement>(null);
  const chart = useRef<uPlot | null>(null);
  useEffect(() => {
    const element = box.current;
    if (!element) return;
    const colour = (name: string) => {
      element.style.color = `var(${name})`;
      return getComputedStyle(element).color;
    };
    const axis = {
      stroke: colour("--muted"),
      grid: { stroke: colour("--line"), width: 1 },
      ticks: { show: false },
      font: "11px system-ui, sans-serif",
    };
    const plot = new uPlot(
      {
        width: Math.max(120, element.clientWidth),
        height: 110,
        legend: { show: false },
        cursor: { show: false },
        scales: { x: { time: false }, y: { range: limits(props.field) } },
        axes: [
          { ...axis, size: 24, space: 60, values: (_, ticks) => ticks.map((one) => `${one} s`) },
          { ...axis, size: 34, space: 26 },
        ],
        series: [
          {},
          { stroke: colour("--accent"), width: 2, fill: colour("--accent-soft"), points: { show: false } },
        ],
      },
      dataOf(props.samples, props.field),
      element,
    );
    chart.current = plot;
    const watch = new ResizeObserver(() =>
      plot.setSize({ width: Math.max(120, element.clientWidth), height: 110 }),
    );
    watch.observe(element);
    return () => {
      watch.disconnect();
      plot.destroy();
    };
  }, [props.field, props.theme]);
  useEffect(() => {
    chart.current?.setData(dataOf(props.samples, props.field));
  }, [props.samples, props.samples.length, props.field]);
  return <div class="plot" ref={box} />;
}

function limits(field: string): uPlot.Scale.Range {
  if (field === "battery") return [0, 100];
  return (_, __, high) => [0, Math.max(1, (high ?? 0) * 1.15)];
}

function dataOf(samples: Sample[], field: "height" | "speed" | "battery"): uPlot.AlignedData {
  const factor = field === "battery" ? 100 : 1;
  return [
    samples.map((one) => one.time),
    samples.map((one) => (one[field] === null ? null : one[field] * factor)),
  ];
}
