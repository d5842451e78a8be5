// A small chart of figures over mission time.

import { useContext, useEffect, useRef } from "preact/hooks";
import uPlot from "uplot";
import { Theme } from "./page";
import "uplot/dist/uPlot.min.css";

const HEIGHT = 110;
const LEAST_WIDTH = 120;

export interface Line {
  values: (number | null)[];
  /** Name of a colour in console.css, such as `--accent`. */
  colour: string;
}

export interface ChartProps {
  times: number[];
  lines: Line[];
  /** Largest figure of the vertical axis; without it, the axis fits the lines, from 0. */
  most?: number;
  /** Mission time that is marked; null for none. */
  cursor: number | null;
  onTime?: ((time: number) => void) | undefined;
}

export function Chart({ times, lines, most, cursor, onTime }: ChartProps) {
  const { shown: theme } = useContext(Theme);
  const box = useRef<HTMLDivElement>(null);
  const chart = useRef<uPlot | null>(null);
  const mark = useRef<{ time: number | null; colour: string }>({ time: cursor, colour: "" });
  const colours = lines.map((line) => line.colour).join();
  useEffect(() => {
    const element = box.current;
    if (!element) return;
    const colour = (name: string) => {
      element.style.color = `var(${name})`;
      return getComputedStyle(element).color;
    };
    mark.current.colour = colour("--ink");
    const axis = {
      stroke: colour("--muted"),
      grid: { stroke: colour("--line"), width: 1 },
      ticks: { show: false },
      font: "11px system-ui, sans-serif",
    };
    const single = lines.length === 1;
    const plot = new uPlot(
      {
        width: Math.max(LEAST_WIDTH, element.clientWidth),
        height: HEIGHT,
        legend: { show: false },
        cursor: { show: false },
        scales: { x: { time: false }, y: { range: limits(most) } },
        axes: [
          { ...axis, size: 24, space: 60, values: (_, ticks) => ticks.map((one) => `${one} s`) },
          { ...axis, size: 34, space: 26 },
        ],
        series: [
          {},
          ...lines.map((line) => ({
            stroke: colour(line.colour),
            width: 2,
            points: { show: false },
            ...(single ? { fill: colour("--accent-soft") } : {}),
          })),
        ],
        hooks: { draw: [(drawn) => drawMark(drawn, mark.current)] },
      },
      dataOf(times, lines),
      element,
    );
    chart.current = plot;
    const watch = new ResizeObserver(() =>
      plot.setSize({ width: Math.max(LEAST_WIDTH, element.clientWidth), height: HEIGHT }),
    );
    watch.observe(element);
    return () => {
      watch.disconnect();
      plot.destroy();
    };
  }, [colours, most, theme]);
  useEffect(() => {
    chart.current?.setData(dataOf(times, lines));
  }, [times, times.length, colours]);
  useEffect(() => {
    if (mark.current.time === cursor) return;
    mark.current.time = cursor;
    chart.current?.redraw(false);
  }, [cursor]);
  const seek = (event: MouseEvent) => {
    const plot = chart.current;
    if (!plot || !onTime) return;
    onTime(plot.posToVal(event.clientX - plot.over.getBoundingClientRect().left, "x"));
  };
  return <div class={`plot ${onTime ? "timed" : ""}`} ref={box} onClick={seek} />;
}

function drawMark(plot: uPlot, mark: { time: number | null; colour: string }): void {
  if (mark.time === null) return;
  const x = plot.valToPos(mark.time, "x", true);
  const { left, top, width, height } = plot.bbox;
  if (!(x >= left && x <= left + width)) return;
  plot.ctx.save();
  plot.ctx.strokeStyle = mark.colour;
  plot.ctx.lineWidth = devicePixelRatio;
  plot.ctx.beginPath();
  plot.ctx.moveTo(x, top);
  plot.ctx.lineTo(x, top + height);
  plot.ctx.stroke();
  plot.ctx.restore();
}

function limits(most: number | undefined): uPlot.Scale.Range {
  if (most !== undefined) return [0, most];
  return (_, low, high) => [Math.min(0, low ?? 0), Math.max(1, (high ?? 0) * 1.15)];
}

function dataOf(times: number[], lines: Line[]): uPlot.AlignedData {
  return [times, ...lines.map((line) => line.values)];
}
