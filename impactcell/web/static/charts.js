// Charts: a band, a line on it, and marks; colours are those of the page.
const colour = (name) => getComputedStyle(document.documentElement).getPropertyValue(`--${name}`).trim();

/** Draws vertical marks with a word each, and horizontal dashed lines with theirs above; no curve runs through a word. */
function drawMarks(plot, marks) {
  const { ctx, bbox } = plot, ratio = devicePixelRatio;
  ctx.save();
  ctx.beginPath();
  ctx.rect(bbox.left, bbox.top, bbox.width, bbox.height);
  ctx.clip();
  ctx.font = `${12 * ratio}px system-ui, sans-serif`;
  ctx.lineWidth = 1.5 * ratio;
  ctx.textAlign = "left";
  ctx.textBaseline = "alphabetic";
  const write = (text, x, y) => {
    ctx.save();
    Object.assign(ctx, { strokeStyle: colour("panel"), lineWidth: 4 * ratio, lineJoin: "round" });
    ctx.setLineDash([]);
    ctx.strokeText(text, x, y);
    ctx.restore();
    ctx.fillText(text, x, y);
  };
  let lastEnd = -Infinity;
  for (const mark of marks) {
    ctx.strokeStyle = ctx.fillStyle = colour(mark.colour);
    ctx.setLineDash(mark.dashed ? [6 * ratio, 4 * ratio] : []);
    ctx.beginPath();
    if (mark.x !== undefined) {
      const x = plot.valToPos(mark.x, "x", true);
      ctx.moveTo(x, bbox.top);
      ctx.lineTo(x, bbox.top + bbox.height);
      const width = ctx.measureText(mark.text).width;
      const at = Math.min(x + 4 * ratio, bbox.left + bbox.width - width - 2 * ratio);
      ctx.stroke();
      if (at > lastEnd) { write(mark.text, at, bbox.top + 13 * ratio); lastEnd = at + width; }
    } else {
      const y = plot.valToPos(mark.y, "y", true);
      ctx.moveTo(bbox.left, y);
      ctx.lineTo(bbox.left + bbox.width, y);
      ctx.stroke();
      const at = bbox.left + bbox.width - ctx.measureText(mark.text).width - 4 * ratio;
      const isTaken = lastEnd > at && y - 18 * ratio < bbox.top + 13 * ratio; // by the word of a vertical mark
      write(mark.text, at, isTaken || y - 16 * ratio < bbox.top ? y + 14 * ratio : y - 5 * ratio);
    }
  }
  ctx.restore();
}

// Steps of a time axis, s; also those between uPlot's own, which leave a narrow chart without a label.
const TIME_STEPS = [1, 2, 5, 10, 15, 20, 30, ...[1, 2, 3, 5, 10, 15, 20, 30].map((m) => 60 * m), ...[1, 2, 3, 4, 6, 12].map((h) => 3600 * h), ...[1, 2, 3, 5, 7, 10, 14].map((d) => 86400 * d)];

const LEAST_SPAN = 0.05; // of an axis, as a share of its value

/** Columns up to the last x at which one of them has a value: no axis goes on beyond what there is. */
function untilTheLast(columns) {
  const [x, ...curves] = columns, last = x.findLastIndex((_, i) => curves.some((curve) => (curve[i] ?? null) !== null));
  return last < 0 ? columns : columns.map((column) => column.slice(0, last + 1));
}

/** A chart in an element. `show` takes columns [x, band low, band high, line, ...]; series are described once. */
export class Chart {
  constructor(element, { unit, xUnit, time = false, band = [1, 2], series, include = [] }) {
    Object.assign(this, { element, unit, xUnit, time, band, series, include, marks: [], data: null });
    this.plot = null;
    new ResizeObserver(() => this.resize()).observe(element);
    document.addEventListener("themechange", () => this.rebuild());
  }

  show(data, marks = []) {
    this.marks = marks;
    this.data = this.time ? data : untilTheLast(data);
    if (this.plot) this.plot.setData(this.data);
    else this.rebuild();
  }

  clear(text) {
    this.plot?.destroy();
    this.plot = this.data = null;
    this.element.textContent = text;
  }

  resize() {
    if (this.plot) this.plot.setSize(this.size());
  }

  size() {
    return { width: Math.max(this.element.clientWidth, 200), height: Math.max(this.element.clientHeight, 120) };
  }

  rebuild() {
    if (!this.data) return;
    this.plot?.destroy();
    this.element.textContent = "";
    const axis = { stroke: colour("soft"), grid: { stroke: colour("grid"), width: 1 }, ticks: { stroke: colour("grid"), width: 1 }, labelSize: 18, labelFont: "12px system-ui, sans-serif" };
    const lang = document.documentElement.lang, clock = { hour: "2-digit", minute: "2-digit", hourCycle: "h23" };
    const times = (_, splits, axis, space, step) => {
      const day = new Intl.DateTimeFormat(lang, { day: "numeric", month: "short" });
      const form = step >= 86400 ? day : new Intl.DateTimeFormat(lang, step >= 60 ? clock : { ...clock, second: "2-digit" });
      const days = splits.map((seconds) => day.format(new Date(seconds * 1e3)));
      const isDated = form !== day && new Set(days).size > 1; // below the first label of each day
      return splits.map((seconds, i) => form.format(new Date(seconds * 1e3)) + (isDated && days[i] !== days[i - 1] ? `\n${days[i]}` : ""));
    };
    // All labels of an axis have as many decimals as its steps need: 0.20 beside 0.22.
    const format = (_, values, axis, space, step) => {
      const isWhole = (value) => Math.abs(value - Math.round(value)) < 1e-6 * value;
      let decimals = 0;
      while (decimals < 12 && !isWhole(step * 10 ** decimals)) decimals++;
      const numbers = new Intl.NumberFormat(lang, { minimumFractionDigits: decimals, maximumFractionDigits: decimals, useGrouping: false });
      return values.map((value) => (value === null ? "" : numbers.format(value)));
    };
    const range = (plot, low, high) => {
      const values = [low, high, ...this.marks.map((mark) => mark.y)].filter((value) => Number.isFinite(value));
      if (!values.length) return [0, 1];
      const least = Math.min(...values), most = Math.max(...values);
      // One value alone gets a span that its labels can tell.
      const room = 0.08 * (Math.max(most - least, LEAST_SPAN * Math.abs(most)) || 1);
      const above = this.marks.some((mark) => mark.y === most) ? 2.5 * room : room; // for its word
      return [least - room, most + above];
    };
    const options = {
      ...this.size(),
      scales: { x: { time: this.time }, y: { range } },
      legend: { show: false },
      cursor: { drag: { x: true, y: false }, points: { size: 6 } },
      axes: [{ ...axis, size: this.time ? 44 : 50, ...(this.time ? { values: times, space: 58, incrs: TIME_STEPS } : { label: this.xUnit, values: format }) }, { ...axis, size: 64, label: this.unit, values: format }],
      series: [{}, ...this.series.map((s) => ({
        stroke: s.colour ? colour(s.colour) : "transparent", width: s.width ?? 0, dash: s.dash,
        points: { show: false }, spanGaps: false,
      }))],
      bands: this.band ? [{ series: [this.band[1], this.band[0]], fill: colour("band") }] : [],
      hooks: { draw: [(plot) => drawMarks(plot, this.marks)] },
    };
    this.plot = new uPlot(options, this.data, this.element);
  }
}
