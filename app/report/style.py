"""How the page looks: light, dark, on a phone and in print. One sheet, which the page allows by its digest."""

from __future__ import annotations

import base64
import hashlib
from typing import Final

STYLE: Final = """
:root { color-scheme: light dark; --bg: #fff; --panel: #f6f7f9; --ink: #1b1f24; --soft: #545c66; --rule: #d5d9df;
  --link: #0b57a4; --bad: #a3201b; --good: #1c6b3a; --grid: #e3e6ea; --axis: #6b737d; --limit: #a3201b;
  --plan: #545c66;
  --quiet: #2b5fa8; --capture: #c23b2e; --castling: #2a7a4b; --en-passant: #8a5a00; --promotion: #7a3fa0;
  --one: #2b5fa8; --two: #b4530a; --sq-light: #f1ece2; --sq-dark: #d9d0c0;
  --q0: #e3f1ea; --q1: #b5dcc9; --q2: #7fbfa8; --q3: #f0c26a; --q4: #d97b3a; --q5: #a3201b; --q-ink: #12161a; }
@media (prefers-color-scheme: dark) { :root { --bg: #14171b; --panel: #1d2126; --ink: #e8eaed; --soft: #aab2bc;
  --rule: #3a4149; --link: #8ec2ff; --bad: #ff9a90; --good: #86d6a4; --grid: #2b3138; --axis: #8c959f;
  --limit: #ff9a90;
  --plan: #aab2bc; --quiet: #7fb0f5; --capture: #ff8b7c; --castling: #79cf9a; --en-passant: #e6b450;
  --promotion: #cf9bf0; --one: #7fb0f5; --two: #f0a35e; --sq-light: #343a41; --sq-dark: #262b31; } }
@media print { :root { color-scheme: light; --bg: #fff; --panel: #fff; --ink: #000; --soft: #333; --rule: #999;
  --link: #000; --bad: #8a1511; --good: #14532d; --grid: #ddd; --axis: #444; --limit: #8a1511; --plan: #333;
  --quiet: #2b5fa8; --capture: #c23b2e; --castling: #2a7a4b; --en-passant: #8a5a00; --promotion: #7a3fa0;
  --one: #2b5fa8; --two: #b4530a; --sq-light: #f7f4ee; --sq-dark: #e2dbce; } }
* { box-sizing: border-box; }
html { -webkit-text-size-adjust: 100%; text-size-adjust: 100%; }
body { margin: 0; background: var(--bg); color: var(--ink);
  font: 1rem/1.5 system-ui, -apple-system, "Segoe UI", Roboto,
  "Helvetica Neue", Arial, sans-serif; }
header, main, footer { max-width: 76rem; margin: 0 auto; padding: 0 1rem; }
header { padding-top: 1.5rem; }
h1 { font-size: clamp(1.4rem, 1.1rem + 1.6vw, 2.1rem); line-height: 1.2; margin: 0 0 .3rem; overflow-wrap: anywhere; }
h2 { font-size: 1.3rem; line-height: 1.3; margin: 2.2rem 0 .6rem; padding-top: .6rem;
  border-top: 1px solid var(--rule); }
h3 { font-size: 1.05rem; margin: 0 0 .3rem; }
p { margin: .4rem 0; max-width: 70ch; }
a { color: var(--link); }
.outcome { font-size: 1.1rem; margin: 0 0 .8rem; overflow-wrap: anywhere; }
.soft, figcaption { color: var(--soft); }
code { font: .88em ui-monospace, Menlo, Consolas, monospace; overflow-wrap: anywhere; }
pre { font: .8rem/1.4 ui-monospace, Menlo, Consolas, monospace; white-space: pre-wrap; overflow-wrap: anywhere; }
.bad { color: var(--bad); } .good { color: var(--good); }
dl { display: grid; grid-template-columns: repeat(auto-fill, minmax(min(100%, 11.5rem), 1fr)); gap: .6rem;
  margin: 0; }
dl > div { background: var(--panel); border: 1px solid var(--rule); border-radius: .5rem; padding: .5rem .7rem; }
dt { color: var(--soft); font-size: .85rem; } dd { margin: 0; font-weight: 600; overflow-wrap: anywhere; }
nav ul { display: flex; flex-wrap: wrap; gap: .2rem 1rem; padding: 0; margin: .6rem 0; list-style: none; }
.charts { display: grid; grid-template-columns: repeat(auto-fit, minmax(min(100%, 27rem), 1fr)); gap: 1rem;
  align-items: start; }
.charts:has(> :only-child) { grid-template-columns: minmax(0, 38rem); }
* + .charts { margin-top: .8rem; }
.chart { margin: 0; background: var(--panel); border: 1px solid var(--rule); border-radius: .5rem; padding: .8rem;
  min-width: 0; }
.chart svg { display: block; width: 100%; height: auto; margin: .4rem 0; overflow: visible; }
.chart p { font-size: .9rem; } .chart h3 { color: var(--ink); }
.key { display: flex; flex-wrap: wrap; gap: .1rem .9rem; color: var(--soft); }
.key span { display: inline-flex; align-items: center; gap: .35rem; }
.chart .key svg { width: .9rem; height: .9rem; margin: 0; flex: none; }
details { margin: .5rem 0 0; } summary { cursor: pointer; color: var(--link); font-size: .9rem; padding: .25rem 0; }
:focus-visible { outline: 2px solid var(--link); outline-offset: 2px; }
.scroll { overflow-x: auto; max-width: 100%; }
.chart .scroll, .tall { max-height: 26rem; overflow-y: auto; border: 1px solid var(--rule); border-radius: .3rem; }
table { border-collapse: collapse; width: 100%; font-size: .88rem; font-variant-numeric: tabular-nums; }
caption { text-align: left; color: var(--soft); padding: .3rem .5rem; font-size: .85rem; }
th, td { text-align: left; padding: .25rem .5rem; border-bottom: 1px solid var(--rule); vertical-align: top; }
thead th { background: var(--panel); position: sticky; top: 0; }
tbody th { font-weight: 600; } .n { text-align: right; white-space: nowrap; }
.moves td, .moves th { white-space: nowrap; }
.incidents { padding-left: 0; list-style: none; margin: 0; }
.incidents li { border-left: 3px solid var(--rule); padding: .1rem 0 .1rem .7rem; margin: .5rem 0; max-width: 80ch;
  overflow-wrap: anywhere; }
.incidents .wrong { border-color: var(--bad); } .incidents .held { border-color: var(--good); }
.incidents code { display: block; }
.incidents .when { color: var(--soft); font-size: .85rem; display: block; }
.strip { display: grid; grid-template-columns: repeat(auto-fill, minmax(min(100%, 10.5rem), 1fr)); gap: .7rem; }
.strip figure { margin: 0; } .strip img { width: 100%; height: auto; display: block; border-radius: .3rem; }
.strip figcaption { font-size: .85rem; }
footer { padding: 1.5rem 1rem 2.5rem; color: var(--soft); font-size: .85rem; }
svg text { font: 11px system-ui, -apple-system, "Segoe UI", Roboto, Arial, sans-serif; fill: var(--ink); }
svg .tick, svg .label { fill: var(--soft); } svg .limit-name { fill: var(--limit); font-size: 10px;
  paint-order: stroke; stroke: var(--panel); stroke-width: 3px; }
.grid { stroke: var(--grid); stroke-width: 1; } .axis { stroke: var(--axis); stroke-width: 1; }
.limit { stroke: var(--limit); stroke-width: 1.4; stroke-dasharray: 6 4; }
.planned { stroke: var(--plan); stroke-width: 1.4; } .stem { stroke: var(--axis); stroke-width: 1; }
.box { fill: var(--grid); stroke: var(--axis); } .median { stroke: var(--ink); stroke-width: 2; }
.m { fill: var(--one); } .m-two { fill: var(--two); }
.k-quiet { fill: var(--quiet); } .k-capture { fill: var(--capture); }
.k-castling { fill: var(--castling); } .k-en_passant { fill: var(--en-passant); }
.k-promotion { fill: var(--promotion); }
.j-inaccuracy { fill: var(--q3); stroke: var(--ink); } .j-mistake { fill: var(--q4); stroke: var(--ink); }
.j-blunder { fill: var(--q5); stroke: var(--ink); }
.line { fill: none; stroke-width: 1.8; stroke-linejoin: round; } .one { stroke: var(--one); }
.two { stroke: var(--two); stroke-dasharray: 5 3; }
.square.light { fill: var(--sq-light); } .square.dark { fill: var(--sq-dark); }
.place { fill: none; stroke: var(--rule); }
.q0 { fill: var(--q0); } .q1 { fill: var(--q1); } .q2 { fill: var(--q2); } .q3 { fill: var(--q3); }
.q4 { fill: var(--q4); } .q5 { fill: var(--q5); } .by-hand { stroke: var(--ink); stroke-dasharray: 3 2; }
svg .value { fill: var(--q-ink); font-size: 10px; } svg .on-q5 { fill: #fff; }
@media (max-width: 30rem) { dl, .strip { grid-template-columns: 1fr 1fr; } .chart { padding: .6rem .5rem; }
  svg text { font-size: 13.5px; } svg .limit-name { font-size: 12px; } svg .value { font-size: 10.5px; } }
@media print { body { font-size: 10pt; } .chart, .strip figure, tr, li { break-inside: avoid; }
h2 { break-after: avoid; }
  table { font-size: 7.5pt; } .n { white-space: normal; } .scroll th, .scroll td { padding: .15rem .3rem; }
  .scroll, .tall, .chart .scroll { max-height: none; overflow: visible; border: 0; } thead th { position: static; }
  .charts { grid-template-columns: 1fr 1fr; } .strip { grid-template-columns: repeat(4, 1fr); }
  summary { color: inherit; } }
""".strip()

STYLE_DIGEST: Final = "sha256-" + base64.b64encode(hashlib.sha256(STYLE.encode()).digest()).decode("ascii")

POLICY: Final = f"default-src 'none'; style-src '{STYLE_DIGEST}'; img-src data:; base-uri 'none'; form-action 'none'"
"""Nothing from elsewhere, no script, no form; the one style sheet and the pictures within the page."""
