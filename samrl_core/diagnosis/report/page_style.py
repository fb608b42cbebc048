"""The style sheet of report.html: dark on light, one column on a phone, fit for paper."""

from __future__ import annotations

STYLE = """
:root { --ink:#1f2933; --soft:#52606d; --line:#d9dee3; --tint:#f5f7f9; --blue:#0072b2; --tone:#52606d;
  --font: system-ui,-apple-system,'Segoe UI',Roboto,'Liberation Sans',sans-serif; }
* { box-sizing:border-box; }
body { margin:0; color:var(--ink); background:#fff; font:16px/1.5 var(--font); -webkit-text-size-adjust:100%;
  }
main, header > div, footer > div { max-width:1120px; margin:0 auto; padding:0 24px; }
.no_gap { --tone:#00735a; --wash:#e8f5f1; } .effect { --tone:#005a8f; --wash:#e8f2f9; }
.ambiguous { --tone:#7a5b00; --wash:#fdf5dd; } .none_of_mine { --tone:#8a2f7a; --wash:#f8ecf6; }
.not_testable { --tone:#4a5561; --wash:#eef1f4; }
header { background:var(--wash); border-top:6px solid var(--tone); padding:28px 0 24px; }
.eyebrow { margin:0 0 10px; color:var(--soft); font-size:14px; overflow-wrap:anywhere; }
.chip { display:inline-block; padding:2px 12px; margin-right:10px; border-radius:99px; background:var(--tone);
  color:#fff; font-weight:600; }
h1 { font-size:clamp(24px,4.2vw,38px); line-height:1.18; margin:0 0 14px; letter-spacing:-.01em;
  max-width:26em;
  overflow-wrap:anywhere; text-wrap:balance; }
header p.lead { font-size:18px; margin:0 0 8px; max-width:48em; }
h2 { font-size:23px; margin:44px 0 6px; padding-top:10px; border-top:2px solid var(--ink); line-height:1.25; }
h3 { font-size:16px; margin:24px 0 4px; overflow-wrap:anywhere; }
p { margin:6px 0 10px; max-width:52em; } .note, figcaption { color:var(--soft); font-size:14px;
  max-width:56em; }
ul { padding-left:22px; margin:6px 0 12px; max-width:56em; } li { margin:3px 0; overflow-wrap:anywhere; }
.figures { display:grid; grid-template-columns:repeat(auto-fill,minmax(150px,1fr)); gap:12px; margin:24px 0
  6px; }
.figures div { border:1px solid var(--line); border-radius:8px; padding:12px 14px; background:#fff; }
.figures dt { color:var(--soft); font-size:13.5px; line-height:1.3; }
.figures dd { margin:4px 0 0; font-size:27px; font-weight:650; line-height:1.15; overflow-wrap:anywhere; }
.figures .unit { font-size:17px; white-space:nowrap; }
.figures small { display:block; font-size:13px; font-weight:400; color:var(--soft); margin-top:3px;
  line-height:1.35;
  overflow-wrap:anywhere; }
dl { margin:0; }
.scroll { overflow-x:auto; margin:8px 0 14px; }
table { border-collapse:collapse; font-size:14.5px; } table.wide { width:100%; }
th, td { text-align:left; padding:6px 12px 6px 0; border-bottom:1px solid var(--line); vertical-align:top; }
th { font-weight:600; color:var(--soft); font-size:13.5px; } td.n, th.n { text-align:right;
  font-variant-numeric:tabular-nums; white-space:nowrap; } td.any { overflow-wrap:anywhere; min-width:9em; }
.heat { border-collapse:separate; border-spacing:2px; width:100%; table-layout:fixed; }
.heat th, .heat td { border:0; padding:7px 4px; text-align:center; font-variant-numeric:tabular-nums; }
.heat th[scope=row] { text-align:right; padding-right:10px; white-space:nowrap; color:var(--ink);
  position:sticky;
  left:0; background:#fff; z-index:1; }
.heat thead td { position:sticky; left:0; background:#fff; z-index:1; }
.heat thead tr:first-child th { border-bottom:1px solid var(--line); color:var(--ink); }
.heat thead th { padding:3px 4px; } .heat td { border-radius:3px; }
.heat td.hot { font-weight:700; outline:2px solid var(--ink); outline-offset:-2px; } .heat td.none {
  color:#7b8794; }
.bar { display:inline-block; width:min(110px,20vw); height:10px; background:#e4e7eb; border-radius:5px;
  overflow:hidden; margin-right:8px; vertical-align:middle; }
.bar i { display:block; height:100%; background:var(--blue); }
td:has(.bar) > span { white-space:nowrap; } .bar.before i { background:#d55e00; }
.box { border-left:5px solid var(--tone); background:var(--wash); padding:12px 18px; margin:14px 0;
  border-radius:4px; }
.box h3 { margin-top:0; } .box p:last-child, .box ul:last-child { margin-bottom:2px; }
.alarm { --tone:#b3261e; --wash:#fdeeec; }
.or { display:grid; grid-template-columns:repeat(auto-fit,minmax(250px,1fr)); gap:14px; margin:12px 0; }
.or > div { border:1px solid var(--line); border-top:4px solid var(--tone); border-radius:6px; padding:12px
  16px; }
.or h3 { margin-top:0; }
pre { background:var(--tint); border:1px solid var(--line); border-radius:6px; padding:12px 14px;
  overflow:auto;
  max-height:420px; font-size:13px; line-height:1.45; } code { font-size:.93em; overflow-wrap:anywhere; }
figure { margin:6px 0 22px; } .plot { width:100%; min-height:120px; }
.plot.failed { border:1px dashed var(--soft); padding:16px; color:var(--soft); }
.pick { display:flex; flex-wrap:wrap; gap:10px 18px; margin:12px 0 6px; } .pick label { font-size:14px; }
.pick select { font:inherit; font-size:15px; padding:5px 8px; border:1px solid #7b8794; border-radius:5px;
  background:#fff; color:var(--ink); max-width:100%; display:block; margin-top:2px; }
:focus-visible { outline:3px solid var(--blue); outline-offset:2px; }
details { margin:10px 0; } summary { cursor:pointer; font-weight:600; padding:4px 0; }
footer { margin:48px 0 0; padding:16px 0 28px; background:var(--tint); font-size:14px; color:var(--soft); }
.hash { font-family:ui-monospace,Menlo,Consolas,'Liberation Mono',monospace; font-size:12px;
  overflow-wrap:anywhere; }
noscript img { max-width:100%; }
@media (max-width:640px) { main, header > div, footer > div { padding:0 14px; } h2 { margin-top:34px; }
  .figures { grid-template-columns:repeat(2,minmax(0,1fr)); gap:8px; } .figures dd { font-size:22px; }
  .figures .unit { font-size:15px; } .figures div { padding:10px; } .heat td { font-size:13px; }
  .heat th { font-size:11.5px; }
  .wide thead { position:absolute; left:-9999px; } .wide, .wide tbody, .wide tr, .wide td { display:block; }
  .wide tr { padding:8px 0; border-bottom:1px solid var(--line); }
  .wide td, .wide td.n { border:0; padding:2px 0; text-align:left; white-space:normal; display:flex; gap:10px;
  }
  .wide td::before { content:attr(data-label); flex:0 0 7.4em; color:var(--soft); font-size:13px;
  line-height:1.65; }
  .wide td > span { min-width:0; flex:1; overflow-wrap:anywhere; } }
@media print { body { font-size:11pt; } header, .box, .heat td, .bar, .chip {
  -webkit-print-color-adjust:exact;
  print-color-adjust:exact; } h2, h3 { break-after:avoid; } figure, tr, .box, .figures div {
  break-inside:avoid; }
  .pick, .modebar { display:none !important; } .scroll, pre { overflow:visible; max-height:none; } }
"""
