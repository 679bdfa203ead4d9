// The search is a worker, which a browser refuses to a page of a folder (file:). There this one
// takes its place, and runs the same script in a hidden frame.
if (location.protocol === "file:") {
  window.Worker = class extends EventTarget {
    constructor(address) {
      super()
      this.waiting = []
      this.frame = document.createElement("iframe")
      this.frame.hidden = true
      this.frame.answer = data => this.dispatchEvent(new MessageEvent("message", { data }))
      this.frame.begin = () => this.begin()
      document.body.append(this.frame)
      const page = this.frame.contentDocument
      page.open()
      page.write(
        "<body><script>postMessage = data => frameElement.answer(data)</script>" +
        `<script src="${address}" onload="frameElement.begin()"></script></body>`
      )
      page.close()
    }

    begin() {
      const waiting = this.waiting
      this.waiting = null
      waiting.forEach(data => this.postMessage(data))
    }

    postMessage(data) {
      if (this.waiting) this.waiting.push(data)
      else this.frame.contentWindow.dispatchEvent(new MessageEvent("message", { data }))
    }
  }
}
